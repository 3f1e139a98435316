"""Claims: over 200 seeds real runs without a difference give at most 2 % false alarms; a real change of 3 % is found.

What is changed on the same runs without a difference is the number of particles, 201 for 200: other random numbers, the
same filter. A real change of 3 % is a measurement variance that a filter takes for larger than it is. `--junitxml=FILE`
writes what was found.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nlbench import config
from nlbench.comparison.compared import Asked, compared_sides
from nlbench.comparison.side import Side
from nlbench.engine.block import words
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make
from nlbench.statistics.summary import tables
from nlbench.statistics.totals import Totals
from tests.comparison import made

SEEDS = 200
CULVER = {"name": "culver-scalar", "ensemble": "matched", "interval": 0.1, "measurement_variance": 1.6}
QUIET = {"~", "="}
pytestmark = pytest.mark.long


class Runs:
    """An experiment, compiled once for all seeds. Its filters get these labels."""

    def __init__(self, system, filters, time, report_times):
        labelled = [{"label": f"f{i + 1}", **each} for i, each in enumerate(filters)]
        plain = {"experiment": "compared", "system": system, "filters": labelled, "time": time}
        self.experiment = config.from_dict({**plain, "report_times": report_times})
        self.compiled = compile_chunks(make(self.experiment), 0)

    def side(self, seed, runs):
        layout = self.compiled.problem.layout
        totals = Totals(layout)
        totals.add(0, self.compiled._replace(seed=words(seed)).sums(0, -(-runs // 64), runs))
        clip = {
            name: most if np.isfinite(most) else None
            for name, most in zip(layout.magnitudes, layout.magnitude_clip, strict=True)
        }
        facts = made.facts(runs, seed, {"units": layout.magnitude_units, "clip": clip, "checksums": {}})
        facts["checksums"] = {
            f"tables/{name}.parquet": f"{self} {seed}"
            for name in ("statistics", "paired", "divergence", "runs")
        }
        return Side(Path(str(seed)), facts, self.experiment, tables(totals))


def alarms(pairs, margin):
    """In how many pairs is there an alarm, and how many comparisons were tested."""
    count, tests = 0, 0
    for a, b in pairs:
        done = compared_sides(a, b, Asked(margin, 0.01))
        count += bool(set(done.table["verdict"]) - QUIET)
        tests += done.tests
    return count, tests


def test_independent_runs_are_seldom_told_apart(record_property):
    filters = [{"name": "linearised-kalman"}, {"name": "second-order"}, {"name": "third-order"}]
    runs = Runs(CULVER, filters, {"end": 2.0, "step": 0.02, "output": 0.5}, [0.5, 1.0, 1.5, 2.0])
    pairs = [(runs.side(2 * seed, 256), runs.side(2 * seed + 1, 256)) for seed in range(SEEDS)]
    for margin in (0.0, 0.01):
        count, tests = alarms(pairs, margin)
        record_property(f"margin {margin}", f"{count} of {SEEDS} pairs, {tests / SEEDS:.1f} tests each")
        assert tests >= 12 * SEEDS
        assert count <= 0.02 * SEEDS


def test_the_same_runs_with_other_random_numbers_are_seldom_told_apart(record_property):
    time = {"end": 20, "step": 1, "output": 5}
    particles, other = (
        Runs({"name": "ungm"}, [{"name": "bootstrap", "particles": n}], time, [5, 10, 15, 20])
        for n in (200, 201)
    )
    pairs = [(particles.side(seed, 256), other.side(seed, 256)) for seed in range(SEEDS)]
    for margin in (0.0, 0.01):
        count, tests = alarms(pairs, margin)
        record_property(f"margin {margin}", f"{count} of {SEEDS} pairs, {tests / SEEDS:.1f} tests each")
        assert tests == 4 * SEEDS
        assert count <= 0.02 * SEEDS


def test_a_change_of_three_percent_is_found(record_property):
    time = {"end": 1.0, "step": 0.02, "output": 0.5}
    right, wrong = (
        Runs(CULVER, [{"name": "linearised-kalman", "model": {"measurement_variance": r}}], time, [1.0])
        for r in (1.6, 1.93)
    )
    true = compared_sides(right.side(10**6, 4096), wrong.side(10**6, 4096), Asked(0.01, 0.01)).table.iloc[0]
    assert true["low"] < 1.03 < true["high"]
    for count in (512, 1024, 2048):
        pairs = ((right.side(seed, count), wrong.side(seed, count)) for seed in range(50))
        found = np.mean([len(compared_sides(a, b, Asked(0.01, 0.01)).failing()) > 0 for a, b in pairs])
        record_property(f"found of {count} runs", found)
    assert found >= 0.9
