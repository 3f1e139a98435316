"""Claim: no figure or table of a source is missing, and documents and experiment files name each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench import config, systems
from nlbench.figures import FIGURES, ON_REQUEST
from nlbench.reproduce import documents, jobs
from nlbench.reproduce.checks import CHECKS
from nlbench.reproduce.pictures import WITHOUT_RUNS

CONFIGS = Path(__file__).parents[2] / "configs"
EXPERIMENTS = {
    path.relative_to(CONFIGS).with_suffix("").as_posix(): config.load(path)
    for path in sorted(CONFIGS.rglob("*.yaml"))
}
ITEMS = [(name, item) for name in documents.NAMES for item in documents.source(name).entries]
FIGURES_OF = {
    "culver-1969": [
        *(f"2.{number}" for number in range(1, 8)),
        *(f"7.{number}" for number in range(1, 31)),
        *(f"8.{number}" for number in range(1, 47)),
    ],
    "schwartz-1967": [str(number) for number in range(1, 13)],
    "henriksen-1980": [],
    "athans-2001": [],
}
TABLES_OF = {"culver-1969": ["5.1", "6.1", "8.1", "8.2", "8.3", "8.4"]}
DIAGRAMS = {f"8.{number}" for number in range(13, 19)}


def names(item):
    return f"{item.kind} {item.number}"


@pytest.mark.parametrize("document", documents.NAMES)
def test_no_figure_or_table_is_missing(document):
    numbers = {
        kind: [each.number for name, each in ITEMS if name == document and each.kind == kind]
        for kind in documents.KINDS
    }
    assert numbers["figure"] == FIGURES_OF[document]
    assert numbers["table"] == TABLES_OF.get(document, [])
    assert len(set(numbers["point"])) == len(numbers["point"])


@pytest.mark.parametrize("document", documents.NAMES)
def test_documents_and_experiments_agree_on_figures_and_tables(document):
    """Each figure and table names exactly the experiments that name it."""
    for kind in ("figure", "table"):
        found = {
            item.number: set(item.experiments)
            for name, item in ITEMS
            if (name, item.kind) == (document, kind)
        }
        named = {number: set() for number in found}
        for name, experiment in EXPERIMENTS.items():
            if experiment.source.document == document:
                for number in getattr(experiment.source, f"{kind}s"):
                    named[number].add(name)
        assert found == named


def test_every_experiment_of_a_source_belongs_to_an_entry_or_an_erratum():
    chosen = set(jobs.choose().experiments)
    of_sources = {name for name, each in EXPERIMENTS.items() if each.source.document in documents.NAMES}
    assert of_sources == chosen


@pytest.mark.parametrize(("document", "item"), ITEMS, ids=[f"{name} {names(item)}" for name, item in ITEMS])
def test_an_entry_names_experiments_and_pictures_that_there_can_be(document, item):
    for name in item.experiments:
        assert EXPERIMENTS[name].source.document == document
    assert item.pictures or not item.experiments or item.kind == "table"
    allowed = FIGURES if item.experiments else WITHOUT_RUNS
    assert {picture.split("-")[0] for picture in item.pictures} <= set(allowed)
    if item.check:
        assert item.check in CHECKS
    assert not item.reason or item.number in {*DIAGRAMS, "2.1"}


def drawn(experiment, picture):
    """Whether an experiment has this picture, as far as its file can tell."""
    kind, _, rest = picture.partition("-")
    wanted = experiment.figures or [name for name in FIGURES if name not in ON_REQUEST]
    coordinate, _, time = rest.partition("-")
    if kind in ("trace", "response"):
        possible = int(rest) in experiment.traces
    elif kind == "density":
        possible = float(time) in experiment.report_times and coordinate in coordinates(experiment)
    else:
        possible = rest in coordinates(experiment)
    return kind in wanted and possible


def coordinates(experiment):
    """Names of the coordinates and norms of an experiment's errors."""
    built = systems.build(experiment.system.name, **experiment.system.parameters)
    return {*(each.name for each in built.coordinates), *built.norms}


@pytest.mark.parametrize(("document", "item"), ITEMS, ids=[f"{name} {names(item)}" for name, item in ITEMS])
def test_every_experiment_of_an_entry_has_each_of_its_pictures(document, item):
    for name in item.experiments:
        missing = [picture for picture in item.pictures if not drawn(EXPERIMENTS[name], picture)]
        assert missing == [], name


@pytest.mark.parametrize("error", documents.errors(), ids=lambda error: f"{error.document} {error.number}")
def test_the_effect_of_an_erratum_compares_two_filters_that_there_are(error):
    for effect in error.effects:
        assert effect.printed in EXPERIMENTS[effect.experiment].labels
        assert effect.corrected in EXPERIMENTS[effect.against or effect.experiment].labels
        assert effect.time is None or effect.time in EXPERIMENTS[effect.experiment].report_times
        if not effect.against:
            assert effect.printed != effect.corrected
    assert all(len(text) <= 130 for text in (error.printed, error.right, error.consequence))


def test_errata_are_numbered_once():
    numbers = [error.number for error in documents.errors()]
    assert len(set(numbers)) == len(numbers)
    letters = {"culver-1969": "C", "schwartz-1967": "S", "henriksen-1980": "H", "athans-2001": "A"}
    assert all(error.number[0] == letters[error.document] for error in documents.errors())


@pytest.mark.parametrize(
    ("source", "figure", "expected"),
    [
        ("schwartz", None, [f"figure {number}" for number in FIGURES_OF["schwartz-1967"]]),
        ("culver", "7.18", ["figure 7.18"]),
        (None, "8.1", ["figure 8.1", "table 8.1"]),
        (None, "table 8.1", ["table 8.1"]),
        ("culver-1969", "Figure 2.1", ["figure 2.1"]),
    ],
)
def test_a_selection_is_what_was_named(source, figure, expected):
    found = [names(item) for _, items in jobs.choose(source, figure).entries for item in items]
    assert found[: len(expected)] == expected
    assert figure is None or len(found) == len(expected)


@pytest.mark.parametrize(
    ("source", "figure", "message"),
    [
        ("culvert", None, "did you mean"),
        ("culver", "7.31", "no source has a '7.31'"),
    ],
)
def test_an_unknown_name_is_told(source, figure, message):
    with pytest.raises(jobs.ConfigError, match=message):
        jobs.choose(source, figure)
