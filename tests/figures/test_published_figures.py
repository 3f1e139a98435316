"""Claim: an experiment file asks a question and says where its numbers come from, its claims where they are made."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench import config

CONFIGS = Path(__file__).parents[2] / "configs"
CULVER = sorted((CONFIGS / "culver").glob("*.yaml"))
SCALAR = [path for path in CULVER if not path.stem.startswith(("oscillator", "orbit", "densities"))]
EVERY = sorted(CONFIGS.rglob("*.yaml"))
# The source's runs by chapter, or by first figure or table.
RUNS = {"2": 100, "7": 80, "7.26": 20, "7.28": 20, "8.1": 20, "8.4": 20, "8.7": 10, "8.10": 10, "8.19": 10,
        "8.23": 10, "8.27": 10, "8.31": 1, "8.37": 1, "table 8.1": 10, "table 8.4": 10}  # fmt: skip


def named(path):
    return path.relative_to(CONFIGS).as_posix()


@pytest.mark.parametrize("path", EVERY, ids=named)
def test_an_experiment_is_named_after_its_file_and_asks_a_question(path):
    experiment = config.load(path)
    assert experiment.experiment == path.relative_to(CONFIGS).with_suffix("").as_posix()
    assert experiment.question.endswith("?")
    assert experiment.claims


@pytest.mark.parametrize("path", EVERY, ids=named)
def test_claims_are_about_the_files_figures_and_say_where_the_source_makes_them(path):
    experiment = config.load(path)
    own = {*experiment.source.figures, *experiment.source.tables}
    for claim in experiment.claims:
        assert set(claim.figures or ()) <= own, claim.id
        # Problems that became known elsewhere are cited as a whole.
        if claim.whose == "source" and named(path).split("/")[0] not in ("problems", "quickstart.yaml"):
            assert claim.where, claim.id


@pytest.mark.parametrize("path", CULVER, ids=named)
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


@pytest.mark.parametrize("path", SCALAR, ids=named)
def test_the_noise_variance_goes_with_the_interval(path):
    """R = .16/interval, of which only 1.6 at .1 s is printed; one file asks what another variance does."""
    parameters = config.load(path).system.parameters
    if parameters["measurement"] not in ("none", "continuous") and path.stem != "series-accurate":
        assert parameters["measurement_variance"] == pytest.approx(0.16 / parameters["interval"], rel=1e-12)
