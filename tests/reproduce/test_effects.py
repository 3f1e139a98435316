"""Claim: what an erratum changes is read off the tables: both values, their paired difference, both ways round."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from nlbench.reproduce.documents import Comparison, Error
from nlbench.reproduce.effects import erratum
from tests import synthetic_run

WORDS = {
    "document": "culver-1969",
    "number": "C1",
    "equation": "(1)",
    "printed": "p",
    "right": "r",
    "consequence": "c",
}


def effects(tmp_path, *comparisons, diverged=None):
    results = synthetic_run.results(tmp_path / "run", diverged=diverged)
    experiments = {
        "here": SimpleNamespace(folder=results.path),
        "there": SimpleNamespace(folder=results.path),
        "gone": SimpleNamespace(folder=None),
    }
    return results, erratum(Error(**WORDS, effects=comparisons), experiments)


def row(table, **keys):
    for key, value in keys.items():
        table = table[table[key] == value]
    (found,) = table.itertuples()
    return found


@pytest.mark.parametrize("swapped", [False, True])
def test_the_difference_is_the_paired_one_in_either_order(tmp_path, swapped):
    labels = ["linearised-kalman", "third-order"][:: -1 if swapped else 1]
    comparison = Comparison(experiment="here", printed=labels[0], corrected=labels[1], statistic="rms")
    results, found = effects(tmp_path, comparison)
    (effect,) = found.effects
    paired = row(
        results.table("paired"),
        filter_a="linearised-kalman",
        filter_b="third-order",
        time=2.0,
        coordinate="x",
        statistic="rms",
    )
    assert effect.difference == pytest.approx((-1 if swapped else 1) * paired.difference, rel=1e-12)
    assert effect.difference_stderr == paired.stderr
    assert effect.difference == pytest.approx(effect.printed - effect.corrected, rel=1e-9)
    assert (effect.time, effect.coordinate, effect.n) == (2.0, "x", 20_000)


def test_values_are_those_of_the_time_asked_for(tmp_path):
    comparison = Comparison(
        experiment="here", printed="linearised-kalman", corrected="exact", statistic="rms", time=1.0
    )
    results, found = effects(tmp_path, comparison, diverged={"exact": 30})
    (effect,) = found.effects
    table = results.table("statistics")
    table = table[table["time"].astype(str) != "all"].astype({"time": float})
    for label, value in (("linearised-kalman", effect.printed), ("exact", effect.corrected)):
        assert value == row(table, filter=label, time=1.0, coordinate="x", statistic="rms").value
    assert (effect.printed_diverged, effect.corrected_diverged) == (0.0, 30 / 20_000)


def test_against_another_experiment_the_difference_is_unpaired(tmp_path):
    comparison = Comparison(
        experiment="here", against="there", printed="third-order", corrected="exact", statistic="rms"
    )
    (effect,) = effects(tmp_path, comparison)[1].effects
    assert effect.against == "there"
    assert effect.difference == effect.printed - effect.corrected
    assert effect.difference_stderr == math.hypot(effect.printed_stderr, effect.corrected_stderr)


def test_an_experiment_that_was_not_run_is_named(tmp_path):
    comparison = Comparison(experiment="gone", printed="a", corrected="b")
    found = effects(tmp_path, comparison)[1]
    assert found.effects == ()
    assert found.why_not == "Not run: gone."
