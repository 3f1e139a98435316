"""Claim: one page leads from any figure to its verdict, and from any number to its table; its twin says the same."""

from __future__ import annotations

import re
from html import unescape
from itertools import pairwise
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

from nlbench.reproduce import page
from nlbench.reproduce.page.contents import contents
from nlbench.reproduce.page.markdown import anchor
from nlbench.reproduce.page.markdown import plain as shown_as_it_is
from nlbench.reproduce.page.pictures import data_address
from nlbench.reproduce.page.standing import standing
from nlbench.reproduce.verdicts import VERDICTS
from tests import synthetic_summary
from tests.parsed_page import Page

HOSTILE = (
    "<script>alert(1)</script>",
    "\"' onload=alert(1) {{ 7*7 }}",
    "</svg></style></details><b>%3Cb%3E &lt;b&gt; #x",
    "| *a* _b_ [c](javascript:d) `e` ![f](g) $h$ </pre>",
    "W" * 300,
)


def written(folder, strings=synthetic_summary.PLAIN, **options):
    """The page's path, the page taken apart, and its twin."""
    place = folder / "results" / "reproduction"
    place.mkdir(parents=True)
    path = page.write(synthetic_summary.summary(place, strings, **options), place)
    return path, Page(path.read_text("utf-8")), (place / "README.md").read_text("utf-8")


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return written(tmp_path_factory.mktemp("plain"))


@pytest.fixture(scope="module")
def hostile(tmp_path_factory):
    return written(tmp_path_factory.mktemp("hostile"), HOSTILE)


@pytest.fixture(params=["plain", "hostile"])
def both(request):
    return request.getfixturevalue(request.param)


def section(path, identifier):
    """Text of the page from the start of a section to the next."""
    text = path.read_text("utf-8").split(f'id="{identifier}"')[1]
    return re.split(r"<(?:section|article) ", text)[0]


def without_code(twin):
    """The twin without the one line that has code, in which nothing is markup."""
    lines = twin.splitlines()
    assert sum(line.startswith("Made by `") for line in lines) == 1
    return "\n".join(line for line in lines if not line.startswith("Made by `"))


def test_every_element_is_closed_and_identifiers_are_unique(both):
    _, parsed, _ = both
    assert not parsed.open
    identifiers = [attributes["id"] for _, attributes in parsed.elements if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))


def test_every_link_and_label_within_the_page_has_a_target(both):
    _, parsed, _ = both
    identifiers = {attributes["id"] for _, attributes in parsed.elements if "id" in attributes}
    for _, attributes in parsed.elements:
        if attributes.get("href", "").startswith("#"):
            assert attributes["href"][1:] in identifiers
        assert set(attributes.get("aria-labelledby", "").split()) <= identifiers


def test_every_other_link_leads_to_a_file_beside_or_below(both):
    path, parsed, _ = both
    addresses = {each["href"] for each in parsed.all("a") if not each["href"].startswith("#")}
    assert len(addresses) == 17
    for address in addresses:
        assert (path.parent / unquote(address)).exists(), address


def test_the_page_asks_the_network_for_nothing(both):
    _, parsed, _ = both
    for tag, attributes in parsed.elements:
        assert tag not in {"link", "iframe", "object", "base"}
        assert attributes.get("src", "data:").startswith("data:")
        assert not re.match(r"[a-z]+:", attributes.get("href", ""))
    policy = next(each["content"] for each in parsed.all("meta") if "http-equiv" in each)
    assert policy.startswith("default-src 'none'; img-src data:;")


def test_headings_leave_out_no_level(both):
    levels = [int(tag[1]) for tag, _ in both[1].elements if re.fullmatch(r"h\d", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_any_figure_is_one_link_from_the_table_and_from_the_list_of_its_source(plain):
    path, parsed, _ = plain
    sections = [each["id"] for each in parsed.all("article") if each.get("class") == "entry" and "id" in each]
    assert len(sections) == 12
    text = path.read_text("utf-8")
    lists = "".join(re.findall(r'<nav class="numbers".*?</nav>', text, re.DOTALL))
    for identifier in sections:
        assert f'href="#{identifier}"' in section(path, "all")
        assert f'href="#{identifier}"' in lists
    menu = text.split('<nav aria-label="Parts of the page">')[1].split("</nav>")[0]
    assert {'href="#all"', 'href="#source-culver-1969"', 'href="#source-schwartz-1967"'} <= set(
        re.findall(r'href="[^"]*"', menu)
    )


def test_the_tables_of_every_number_are_linked_from_its_section(plain):
    path, _, _ = plain
    found = section(path, "culver-1969-figure-7-1")
    for table in ("claims.csv", "sets.csv", "statistics.csv"):
        assert f'href="../culver/a/tables/{table}"' in found
    assert 'href="../culver-a%20file.yaml"' in found


def test_the_section_of_a_figure_says_all_that_was_found(plain):
    found = unescape(re.sub(r"<[^>]*>", "", section(plain[0], "culver-1969-figure-7-1")))
    for part in (
        "Figure 7.1: order three",
        "REPRODUCED",
        "What would change it: order three",
        "✓ confirmed, holds: order three",
        "✗ refuted, differs",
        "of the source, section 7.3, page 7-9",
        "ours, which does not count for the verdict",
        "−0.0123 [−0.02, 0.004]",
        "sets of 80 (as the source)seen in 93\u00a0% [92, 94]",
        "20,000 runs, the source had 80, seed 1969",
        "# Printed: the drift. Inferred: the noise",
    ):
        assert part in found


def test_every_verdict_is_counted_and_explained(plain):
    path, _, _ = plain
    card = section(path, "summary")
    counts = re.findall(r"</span> ([^<]*)</dt><dd><b>(\d+)</b>", card)
    expected = [2 * (2 if verdict == "REPRODUCED" else 1) for verdict in VERDICTS]
    assert [(unescape(verdict), int(count)) for verdict, count in counts] == list(
        zip(VERDICTS, expected, strict=True)
    )
    for fact in ("40,000", "1969", "1.2.3", "76.1 min", "2 of 3"):
        assert f"<dd>{fact}</dd>" in card


def test_what_failed_says_so(tmp_path):
    path, _, twin = written(tmp_path, ("out of memory",))
    assert "failed: out of memory." in section(path, "schwartz-1967-figure-7-1")
    assert "failed: out of memory." in twin


def test_a_picture_tells_its_claim_and_verdict(plain):
    names = [each["alt"] for each in plain[1].all("img")]
    assert len(names) == 10
    for name in names:
        assert any(
            f", {verdict}, claimed: order three beats order two; order" in name for verdict in VERDICTS
        )


def test_a_picture_names_its_experiment_where_there_are_several(plain):
    titles = re.findall(r"<figcaption>\n<p>(.*?) <span", plain[0].read_text("utf-8"))
    assert titles == ["order three beats order two"] * 5 + ["schwartz/b: order three beats order two"] * 5


def test_a_picture_survives_the_way_into_an_attribute():
    svg = synthetic_summary.SVG.format("100 %41 'sure' &amp; #1")
    (element,) = Page(f"<img src='{data_address(svg)}'>").all("img")
    kind, data = element["src"].split(",", 1)
    assert kind == "data:image/svg+xml;charset=utf-8"
    shown, drawn = (
        list(ElementTree.fromstring(text).iter())
        for text in (unquote(data), re.sub(r"\n(?=L)", " ", svg.split("?>")[1]))
    )
    assert [(each.tag, each.attrib) for each in shown] == [(each.tag, each.attrib) for each in drawn]
    assert [(each.text or "").strip() for each in shown] == [(each.text or "").strip() for each in drawn]


def test_errata_have_their_effect_both_ways_or_say_why_not(plain):
    found = section(plain[0], "erratum-culver-1969-C3")
    for part in (
        "0.2500 ± 0.0040",
        "0.2400 ± 0.0040",
        "0.0100 ± 0.0010",
        "2.0\u00a0%",
        "clipped RMS error of x",
    ):
        assert part in found
    assert ">–</td>" in found
    assert "against third-order in schwartz/b" in found
    assert "order three" in section(plain[0], "erratum-schwartz-1967-S1")


def test_what_users_write_is_shown_and_never_run(hostile):
    path, parsed, twin = hostile
    assert len(parsed.all("script")) == 1
    assert {
        each for _, attributes in parsed.elements for each in attributes if each.startswith("on")
    } == set()
    assert all(parsed.text.count(text) >= 4 for text in HOSTILE)
    bold = re.findall(r"<b>([^<]*)", path.read_text("utf-8"))
    assert not any("%3Cb" in text for text in bold)
    text = without_code(twin)
    assert not re.search(r"(?<!\\)<[a-z/!]", text)
    assert not re.search(r"(?<!\\)\](?=\(javascript)", text)


def test_standing_is_read_from_comments():
    text = """# Does it pay?
# Culver 1969.
experiment: a

# Printed: the drift (7.1). Inferred: the noise, from 7.4; its step. Chosen: the ensemble,
# without escapes.
system: {name: culver-scalar}
filters: # printed, section 7.3
  - third-order # chosen: the best
time: {end: 2.0} # end printed, step inferred, output chosen
report_times: [1.0] # chosen
# To all times (chosen: from t = 1).
claims:
  - id: C1 # chosen
"""
    found = standing(text)
    assert found.inferred == ("system: the noise, from 7.4; its step", "time: {end: 2.0}: step inferred")
    assert found.chosen == (
        "system: the ensemble, without escapes",
        "third-order: the best",
        "time: {end: 2.0}: output chosen",
        "report_times: [1.0]",
        "claims: from t = 1",
    )


def test_assumptions_name_all_experiments_that_share_them(plain):
    found = section(plain[0], "assumptions")
    assert "system: the noise, order three beats order two" in found
    assert "culver/a, schwartz/b, schwartz/c" in found


def test_the_twin_has_every_verdict_of_the_page(both):
    path, _, twin = both
    summary = synthetic_summary.summary(path.parent)
    for entry in summary.entries:
        pattern = rf"^\| \[{entry.name.capitalize().replace('.', '[.]')}\]\(#[^)]*\) \| . {re.escape(entry.verdict)} \|"
        assert re.search(pattern, twin, re.MULTILINE)


def test_the_links_of_the_twin_lead_somewhere(both):
    path, _, twin = both
    headings = [
        anchor(re.sub(r"\\(.)", r"\1", line.lstrip("# ")))
        for line in twin.splitlines()
        if line.startswith("#")
    ]
    assert len(headings) == len(set(headings))
    addresses = re.findall(r"(?<!\\)\]\(([^)]*)\)", without_code(twin))
    pictures = re.findall(r"^!\[.*\]\((.*)\)$", twin, re.MULTILINE)
    assert len(pictures) == 10
    assert all(address.startswith("figures/") for address in pictures)
    for address in addresses:
        assert address in headings if address.startswith("#") else (path.parent / unquote(address)).exists()


def test_the_rows_of_the_twin_s_tables_are_as_long_as_their_heads(both):
    tables = re.findall(r"(?:^\|.*\n)+", both[2], re.MULTILINE)
    assert len(tables) == 5
    for table in tables:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1


@pytest.mark.parametrize(
    ("text", "written_as"),
    [("1. a\n- b", r"1\. a - b"), ("- a", r"\- a"), ("a_b*c", r"a\_b\*c"), ("7.1 x", "7.1 x"), ("=", r"\=")],
)
def test_markdown_shows_text_as_it_is(text, written_as):
    assert shown_as_it_is(text) == written_as


def test_page_and_twin_are_the_same_whenever_they_are_written(tmp_path):
    path, _, twin = written(tmp_path)
    first = path.read_bytes()
    page.write(synthetic_summary.summary(path.parent), path.parent)
    assert path.read_bytes() == first
    assert (path.parent / "README.md").read_text("utf-8") == twin


def test_a_reproduction_of_nothing_is_a_page(tmp_path):
    summary = synthetic_summary.summary(tmp_path)._replace(documents=(), errata=(), experiments={}, totals={})
    assert contents(summary, tmp_path).counts[0].entries == 0
    assert not Page(page.write(summary, tmp_path).read_text("utf-8")).open
