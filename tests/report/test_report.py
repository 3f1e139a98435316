"""Claim: the report is one page that needs nothing else, says who wins, and shows what users wrote as they wrote it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest

from nlbench import report
from tests import synthetic_run

QUICK = {"figures": ["mean_error"]}  # of experiments whose figures are not looked at
VOID = {"meta", "link", "br", "img", "input", "hr"}


class Page(HTMLParser):
    """Elements with their attributes, text, and whether every element is closed."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        self.text += text

    def all(self, tag):
        return [attributes for name, attributes in self.elements if name == tag]


def written(run):
    path = report.write(run)
    return path, path.read_text("utf-8")


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    tables = {
        "claims": synthetic_run.claims(),
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
