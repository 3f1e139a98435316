"""Claim: no filter, system, key, command or public name is without its place in the documentation."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from pydantic import BaseModel

import nlbench
from docs.generator import filters, site
from docs.generator.text import docstring, escaped, markdown, sentences
from nlbench import systems
from nlbench.config.assemble import SECTIONS, Named
from nlbench.config.claim import Claim
from nlbench.config.schema import Experiment, Head, Initial, TimeSpec
from nlbench.filters import catalogue

FENCED = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
SECTIONS_OF_A_FILE = (Head, Named, TimeSpec, Initial, Claim, *SECTIONS.values())


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> Path:
    """All pages, gathered."""
    folder = tmp_path_factory.mktemp("site")
    site.gather(folder)
    return folder / "pages"


def fields(model: type[BaseModel]) -> set[str]:
    return set(model.model_fields)


@pytest.mark.parametrize("name", catalogue.available())
def test_a_filter_has_a_page_with_its_source_and_options_and_equations(pages, name):
    text = (pages / "filters" / f"{name}.md").read_text()
    for kind in catalogue.takes(name):
        row = catalogue.row(name, *kind)
        assert escaped(row.source) in text
        assert all(f"| `{option}` |" in text for option in fields(row.options))
        assert all(markdown(docstring(module)) in text for module in filters.modules(row))
    assert f"[{name}]({name}.md)" in (pages / "filters" / "index.md").read_text()


def test_equations_of_a_filter_are_numbered():
    """The modules that are shown are those that hold equations, not some that only import them."""
    rows = {catalogue.row(name, *kind) for name in catalogue.available() for kind in catalogue.takes(name)}
    without = [row.says for row in rows if not any("(1)" in docstring(name) for name in filters.modules(row))]
    assert without == []


def test_notes_are_of_filters_that_there_are_and_their_anchors_exist():
    notes = filters.notes()
    assert set(notes) == set(catalogue.available())
    for name, note in notes.items():
        page, anchor = note.see.split("#")
        text = (site.WRITTEN / "filters" / page).read_text()
        assert f"{{#{anchor}}}" in text, name


def test_each_filter_is_linked_from_the_page_that_derives_it():
    for name, note in filters.notes().items():
        written = " ".join(
            (site.WRITTEN / "filters" / f"{page}.md").read_text()
            for page in ("moment", "continuous", "discrete")
        )
        guarded = name.endswith("-guarded")  # named together, as the `-guarded` filters
        assert guarded or f"({name}.md)" in written, f"{name}: {note.see}"


@pytest.mark.parametrize("name", systems.available())
def test_a_system_has_a_page_with_its_equations_and_parameters(pages, name):
    text = (pages / "systems" / f"{name}.md").read_text()
    assert markdown(docstring(systems.MODULES[name]).partition("\n\n")[2]) in text
    model = systems.parameters(name)
    assert all(f"| `{each}` |" in text for each in fields(model))
    assert [each for each, field in model.model_fields.items() if not field.description] == []


def test_every_key_of_a_file_is_explained(pages):
    text = (pages / "experiment.md").read_text()
    for model in SECTIONS_OF_A_FILE:
        assert [key for key, field in model.model_fields.items() if not field.description] == [], model
        assert all(f"| `{key}` |" in text for key in fields(model)), model
    assert all(f"`{key}`" in text for key in fields(Experiment) - {"question"})


def test_every_command_and_public_name_is_there(pages):
    from typer.main import get_command

    from nlbench.cli.app import app

    commands, api = (pages / "commands.md").read_text(), (pages / "api.md").read_text()
    for name, command in get_command(app).commands.items():
        assert f"## nlbench {name}\n" in commands
        assert all(option in commands for each in command.params for option in each.opts if option[0] == "-")
    assert [name for name in nlbench.__all__ if f"## nb.{name}\n" not in api] == []
    assert "### nb.systems.build\n" in api


def test_links_lead_to_pages_that_there_are(pages):
    broken = []
    for page in pages.rglob("*.md"):
        for aim in re.findall(r"\]\(([^)#\s]+)", FENCED.sub("", page.read_text())):
            if not aim.startswith(("http://", "https://", "mailto:")) and not (page.parent / aim).exists():
                broken.append(f"{page.relative_to(pages)}: {aim}")
    assert broken == []


def test_every_page_is_in_the_menu(pages):
    def names(entries):
        for each in entries:
            for inner in each.values() if isinstance(each, dict) else ():
                yield from names(inner)
            if isinstance(each, str):
                yield each

    found = list(names(site.navigation(pages)))
    assert len(found) == len(set(found))
    assert set(found) == {str(page.relative_to(pages)) for page in pages.rglob("*.md")}


def test_the_menu_leaves_out_a_page_that_is_not_there(pages, tmp_path):
    assert "tutorial.md" not in json.dumps(site.navigation(tmp_path))


def test_indented_lines_of_a_docstring_stand_as_they_are_and_prose_means_nothing_to_markdown():
    text = "About x_i <b>, `a_b`:\n  (1) m*  = 2\n  (2) n = 3\nand *more*."
    assert markdown(text) == (
        "About x\\_i &lt;b&gt;, `a_b`:\n\n```text\n(1) m*  = 2\n(2) n = 3\n```\n\nand \\*more\\*."
    )


def test_sentences_end_where_they_end():
    text = "Exact. Cost O(n^4). Fails when 1 + nu\ncomes near .25, say. `clipped` is more."
    assert sentences(text, "Cost") == ["Cost O(n^4)."]
    assert sentences(text, "Fails") == ["Fails when 1 + nu comes near .25, say."]
