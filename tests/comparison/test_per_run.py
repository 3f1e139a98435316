"""Claims: kept runs give the same values and standard errors as the tables, which are made of sums."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.comparison.per_run import PerRun, influences, per_run
from nlbench.comparison.significance import standard_error
from nlbench.statistics.comparisons import Quantity
from nlbench.statistics.paired import paired_table
from nlbench.statistics.sets import KeptTable
from nlbench.statistics.summary import runs_table, statistics_table
from tests.statistics import made_runs

KEPT = ("rms", "rms_clipped", "mean_error", "variance_estimated", "variance_actual", "third_estimated")
KEPT += ("third_actual", "nees", "coverage_95")


@pytest.fixture(scope="module")
def made():
    layout = made_runs.layout(filters=2)
    totals = made_runs.total(made_runs.make(layout, 700, seed=3), layout)
    clip = dict(zip(layout.magnitudes, layout.magnitude_clip, strict=True))
    norms = {name: [layout.coordinates[i] for i in members] for name, members in layout.norms.items()}
    return layout, totals, KeptTable(runs_table(totals), clip, norms)


def test_values_and_standard_errors_are_those_of_the_table(made):
    layout, totals, kept = made
    checked = set()
    for row in statistics_table(totals).itertuples():
        if row.statistic not in KEPT or row.coordinate == "all" or row.time == "all":
            continue
        if float(row.time) not in layout.report_times:
            continue
        own = per_run(kept, Quantity(row.filter, float(row.time), row.coordinate, row.statistic))
        assert isinstance(own, PerRun)
        value, influence = influences(row.statistic, own.values[own.counted])
        assert own.counted.sum() == row.n
        # Stated moments are kept in single precision; a stated variance may be anywhere near zero in a quotient.
        assert value == pytest.approx(row.value, rel=2e-6, abs=1e-7), row
        if row.statistic != "nees":
            assert standard_error(influence) == pytest.approx(row.stderr, rel=1e-4), row
        checked.add((row.statistic, row.coordinate))
    assert {name for name, _ in checked} == set(KEPT)
    assert ("rms", "both") in checked
    assert ("rms_clipped", "both") in checked


def test_differences_of_influences_give_the_standard_errors_of_the_paired_table(made):
    _, totals, kept = made
    rows = paired_table(totals)
    assert len(rows)
    for row in rows.itertuples():
        own = [
            per_run(kept, Quantity(label, row.time, row.coordinate, row.statistic))
            for label in (row.filter_a, row.filter_b)
        ]
        both = own[0].counted & own[1].counted
        a, b = (influences(row.statistic, each.values[both]) for each in own)
        assert a.value - b.value == pytest.approx(row.difference, rel=1e-9, abs=1e-12)
        assert standard_error(a.influence - b.influence) == pytest.approx(row.stderr, rel=1e-9)
        assert both.sum() == row.n


def test_what_is_not_kept_is_not_made_up(made):
    _, _, kept = made
    for coordinate, statistic in (
        ("all", "nees"),
        ("position", "median_error"),
        ("both", "mean_error"),
        ("none", "rms"),
    ):
        assert per_run(kept, Quantity("filter 1", 0.5, coordinate, statistic)) is None
    assert per_run(kept, Quantity("filter 1", 1.0, "position", "rms")) is None


@pytest.mark.parametrize("statistic", KEPT)
def test_the_influence_is_the_change_when_a_run_is_counted_once_more(statistic):
    values = np.random.default_rng(1).gamma(2.0, size=4000)
    value, influence = influences(statistic, values)
    more = [influences(statistic, np.append(values, values[i])).value for i in range(5)]
    np.testing.assert_allclose(4001 * (np.array(more) - value), influence[:5], atol=0.02)
    assert abs(influence.mean()) < 1e-9
