"""Claim: the report is one page that needs nothing else, says who wins, and shows what users wrote as they wrote it."""

from __future__ import annotations

import re
from urllib.parse import unquote

import pytest

from nlbench import report
from nlbench.errors import LockedError
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from tests import synthetic_run
from tests.browser import ABSENT, EXECUTABLE, Browser, Tab
from tests.parsed_page import Page

QUICK = {"figures": ["mean_error"]}  # of experiments whose figures are not looked at


def written(run):
    path = report.write(run)
    return path, path.read_text("utf-8")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    tables = {
        "claims": synthetic_run.claims(),
        "sets": synthetic_run.sets(),
        "cost": synthetic_run.cost(),
        "consistency": synthetic_run.consistency(synthetic_run.FACTORS, 20_000),
    }
    run = synthetic_run.results(
        folder, coordinates={"position": "ft", "speed": "ft/s"}, diverged={"third-order": 37}, tables=tables
    )
    return written(run)


def test_the_page_is_in_the_folder_of_the_run(page):
    assert page[0].name == "report.html"
    assert (page[0].parent / "manifest.json").exists()


def test_no_report_is_written_while_a_run_writes(page):
    folder = page[0].parent
    before = page[0].read_bytes()
    with RunFolder(folder).locked(), pytest.raises(LockedError, match="is in use by process"):
        report.write(Results(folder))
    assert page[0].read_bytes() == before


def test_every_element_is_closed(page):
    assert not Page(page[1]).open


def test_the_page_asks_the_network_for_nothing(page):
    path, text = page
    assert not re.search(r"https?:|//[a-z]", text.replace("// Tables are", ""))
    for tag, attributes in Page(text).elements:
        assert tag not in {"link", "img", "iframe", "object", "base"}
        assert "src" not in attributes
        address = attributes.get("href", "#")
        assert address.startswith("#") or (path.parent / unquote(address)).exists(), address


def test_links_lead_to_every_table_and_figure(page):
    path, text = page
    linked = {unquote(attributes["href"]) for attributes in Page(text).all("a")}
    files = {
        str(file.relative_to(path.parent))
        for kind in ("tables", "figures")
        for file in (path.parent / kind).iterdir()
    }
    assert files <= linked
    assert {"manifest.json", "config.resolved.yaml"} <= linked


def test_links_within_the_page_have_a_target_and_identifiers_are_unique(page):
    elements = Page(page[1]).elements
    identifiers = [attributes["id"] for _, attributes in elements if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    for _, attributes in elements:
        if attributes.get("href", "").startswith("#"):
            assert attributes["href"][1:] in identifiers
        for name in attributes.get("aria-labelledby", "").split():
            assert name in identifiers


def test_every_figure_has_a_text_instead(page):
    figures = Page(page[1]).all("svg")
    assert len(figures) == 12
    assert all(attributes["role"] == "img" and attributes["aria-labelledby"] for attributes in figures)
    assert page[1].count("<title id=") == page[1].count("<desc id=") == 12


def test_tables_have_headings_of_rows_and_columns(page):
    parsed = Page(page[1])
    scopes = [attributes.get("scope") for attributes in parsed.all("th")]
    assert set(scopes) == {"row", "col"}
    assert all(attributes["aria-labelledby"] for attributes in parsed.all("table"))


def test_optional_parts_appear_with_their_tables_only(page, tmp_path):
    for part in (
        'id="claims"',
        'id="cost"',
        'id="consistency"',
        "✓ confirmed",
        "✗ refuted",
        "? undecided",
        "125",
    ):
        assert part in page[1]
    bare = written(synthetic_run.results(tmp_path, **QUICK))[1]
    assert 'id="claims"' not in bare
    assert 'id="cost"' not in bare
    assert 'id="consistency"' not in bare


def test_consistency_is_told_in_words(page):
    section = page[1].split('<section id="consistency">')[1].split("</section>")[0]
    rows = {row.split("<")[0]: row for row in section.split('class="name">')[1:]}
    assert "2.600 ± 0.014, overconfident" in rows["linearised-kalman"]
    assert "1.800 ± 0.014, too cautious" in rows["exact"]
    assert "1.000 ± 0.010, consistent" in rows["exact"]
    assert "1.000 ± 0.010, selected" in rows["third-order-guarded"]


def test_each_claim_says_whose_it_is_and_how_often_few_runs_show_it(page, tmp_path):
    section = page[1].split('<section id="claims">')[1].split("</section>")[0]
    for part in ("section 7.3, page 7-9", ">source<", ">ours<", "sets of 10<", "sets of 80 (as the source)"):
        assert part in section
    seen = re.findall(r'class="number">(seen in [^<]*|–)</td>', section)
    assert seen == [
        "seen in 63\u00a0% [61, 65]",
        "seen in 93\u00a0% [89, 96]",
        "–",
        "seen in 0\u00a0% [0, 1.5]",
    ]
    without = synthetic_run.results(tmp_path, tables={"claims": synthetic_run.claims()}, **QUICK)
    assert "seen in" not in written(without)[1]


def test_divergence_is_counted_in_words(page, tmp_path):
    assert "37 of 20,000" in page[1]
    assert "Some runs diverged" in page[1]
    assert "Some runs diverged" not in written(synthetic_run.results(tmp_path, **QUICK))[1]


def test_what_users_write_is_shown_and_never_run(tmp_path):
    hostile = ["<script>alert(1)</script>", "\"' onload=x {{ 7*7 }}", "</svg></style><b>", "W" * 60]
    claims = synthetic_run.claims().assign(says=hostile[:3])
    run = synthetic_run.results(
        tmp_path,
        {**dict.fromkeys(hostile, 1.2), "exact": 1.0},
        coordinates={"x": hostile[2]},
        diverged={hostile[0]: 2},
        tables={"claims": claims},
        question=f"Is {hostile[0]} safe?",
        source={"document": hostile[1], "runs": 80},
    )
    parsed = Page(written(run)[1])
    assert not parsed.open
    assert all(parsed.text.count(text) >= 4 for text in hostile)
    assert len(parsed.all("script")) == 1
    assert not parsed.all("b")
    assert not any("onload" in attributes for _, attributes in parsed.elements)


def test_the_heading_is_the_question_or_else_the_name(page, tmp_path):
    assert "<h1>tests/synthetic</h1>" in page[1]
    asking = written(synthetic_run.results(tmp_path, question="Who wins?", **QUICK))[1]
    assert "<h1>Who wins?</h1>" in asking


def test_a_run_in_which_all_failed_says_so(tmp_path):
    factors = {"third-order": float("nan")}
    text = written(synthetic_run.results(tmp_path, factors, diverged={"third-order": 20_000}, **QUICK))[1]
    assert "No filter gave a usable estimate" in text
    assert ">failed</td>" in text


@pytest.mark.skipif(not EXECUTABLE, reason=ABSENT)
def test_a_browser_shows_it_without_complaint_and_sorts_its_tables(page):
    with Browser() as browser:
        tab = Tab(browser, page[0], width=360, height=800)
        rows = "[...document.querySelectorAll('#errors tbody tr th')].map(head => head.textContent)"
        before = tab.run(rows)
        tab.run("document.querySelector('#errors thead button').focus()")
        tab.press("Enter")
        assert tab.run(rows) != before
        assert not tab.complaints
        assert tab.requests == [page[0].as_uri()]
        assert tab.run("document.documentElement.scrollWidth") <= 360
