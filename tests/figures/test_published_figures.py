"""Claim: the experiment files cover the sources' figures and tables as far as listed; each says what it asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench import config

CONFIGS = Path(__file__).parents[2] / "configs"
CULVER = sorted((CONFIGS / "culver").glob("*.yaml"))
SCALAR = [path for path in CULVER if not path.stem.startswith(("oscillator", "orbit"))]
EXPECTED = {
    *(f"7.{number}" for number in range(1, 31)),
    *(f"8.{number}" for number in (*range(1, 13), *range(19, 47))),
}
TABLES = {"8.1", "8.2", "8.3", "8.4"}
SCHWARTZ = {str(number) for number in range(3, 13)}  # 1 and 2 show a response without filters
EVERY = sorted(CONFIGS.rglob("*.yaml"))
# By chapter, or by first figure or table.
RUNS = {"7": 80, "8.1": 20, "8.4": 20, "8.7": 10, "8.10": 10, "8.19": 10, "8.23": 10, "8.27": 10}
RUNS |= {"8.31": 1, "8.37": 1, "table 8.1": 10, "table 8.4": 10}


def test_every_figure_and_table_is_covered():
    sources = [config.load(path).source for path in CULVER]
    assert {figure for each in sources for figure in each.figures} == EXPECTED
    assert {table for each in sources for table in each.tables} == TABLES
    schwartz = [config.load(path).source for path in (CONFIGS / "schwartz").glob("*.yaml")]
    assert {figure for each in schwartz for figure in each.figures} == SCHWARTZ


@pytest.mark.parametrize("path", EVERY, ids=lambda path: path.relative_to(CONFIGS).as_posix())
def test_an_experiment_is_named_after_its_file_and_asks_a_question(path):
    experiment = config.load(path)
    assert experiment.experiment == path.relative_to(CONFIGS).with_suffix("").as_posix()
    assert experiment.question.endswith("?")
    assert experiment.claims or experiment.source.tables


@pytest.mark.parametrize("path", CULVER, ids=lambda path: path.stem)
def test_every_parameter_says_whether_it_is_printed_inferred_or_chosen(path):
    text = path.read_text().lower()
    assert "printed" in text
    assert "chosen" in text
    if path in SCALAR:
        measured = "measurement: none" not in text
        assert ("inferred" in text) == measured
    source = config.load(path).source
    first = source.figures[0] if source.figures else f"table {source.tables[0]}" if source.tables else "7.1"
    assert source.runs == RUNS.get(first, RUNS.get(first.split(".")[0]))


@pytest.mark.parametrize("path", SCALAR, ids=lambda path: path.stem)
def test_the_noise_variance_goes_with_the_interval(path):
    """R = .16/interval, of which only 1.6 at .1 s is printed; one file asks what another variance does."""
    parameters = config.load(path).system.parameters
    if parameters["measurement"] not in ("none", "continuous") and path.stem != "series-accurate":
        assert parameters["measurement_variance"] == pytest.approx(0.16 / parameters["interval"], rel=1e-12)
