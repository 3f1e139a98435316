"""Claim: the experiment files cover the thesis's figures 7.1-7.6 and 7.16-7.25, and each says what it asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench import config

CONFIGS = Path(__file__).parents[2] / "configs"
CULVER = sorted((CONFIGS / "culver").glob("*.yaml"))
EXPECTED = {f"7.{number}" for number in (*range(1, 7), *range(16, 26))}


def test_every_figure_is_covered_once():
    covered = [figure for path in CULVER for figure in config.load(path).source.figures if figure in EXPECTED]
    assert sorted(covered) == sorted(EXPECTED)


@pytest.mark.parametrize("path", [CONFIGS / "quickstart.yaml", *CULVER], ids=lambda path: path.stem)
def test_an_experiment_is_named_after_its_file_and_asks_a_question(path):
    experiment = config.load(path)
    assert experiment.experiment == path.relative_to(CONFIGS).with_suffix("").as_posix()
    assert experiment.question.endswith("?")
    assert experiment.claims


@pytest.mark.parametrize("path", CULVER, ids=lambda path: path.stem)
def test_every_parameter_says_whether_it_is_printed_inferred_or_chosen(path):
    text = path.read_text().lower()
    assert "printed" in text
    assert "chosen" in text
    measured = "measurement: none" not in text
    assert ("inferred" in text) == measured
    assert config.load(path).source.runs == 80


@pytest.mark.parametrize("path", CULVER, ids=lambda path: path.stem)
def test_the_noise_variance_goes_with_the_interval(path):
    """R = .16/interval, of which only 1.6 at .1 s is printed."""
    parameters = config.load(path).system.parameters
    if parameters["measurement"] != "none":
        assert parameters["measurement_variance"] == pytest.approx(0.16 / parameters["interval"], rel=1e-12)
