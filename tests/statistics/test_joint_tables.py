"""Cross moments, paired differences, divergence and kept runs equal plain NumPy over all runs at once."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nlbench.statistics import summary
from nlbench.statistics.moments import moments_table
from nlbench.statistics.paired import paired_table
from tests.statistics import made_runs


def test_every_table_has_the_columns_of_the_contract(sample):
    tables = summary.tables(sample[2])
    columns = {name: list(table.columns) for name, table in tables.items()}
    assert columns.keys() == {"statistics", "moments", "paired", "divergence", "runs"}
    moments = ["filter", "time", "indices", "estimated", "actual", "stderr", "n"]
    assert columns["moments"] == [*moments, "names", "estimated_stderr"]
    assert columns["paired"] == [
        *("filter_a", "filter_b", "time", "coordinate", "statistic", "difference", "stderr", "n", "p_value"),
    ]
    assert columns["divergence"][:8] == [
        *("filter", "n", "diverged", "fraction", "low", "high", "first_time_median", "guarded"),
    ]
    stated = [f"{name}_{moment}" for moment in ("variance", "third") for name in ("position", "velocity")]
    assert columns["runs"] == ["filter", "time", "run", "position", "velocity", *stated, "diverged"]


def test_cross_moments_equal_numpy(sample):
    layout, runs, totals = sample
    bad = made_runs.lost(runs, layout)
    rows = moments_table(totals).set_index(["filter", "time", "indices"])
    assert len(rows) == 3 * 2 * (3 + 4)
    for (label, time, indices), row in rows.iterrows():
        f, t = layout.filters.index(label), layout.times.index(time)
        component = tuple(int(i) - 1 for i in indices.split(","))
        good = ~bad[f, t]
        x = runs.error[f, t][:, good]
        x = x - x.mean(axis=1, keepdims=True)
        own = (runs.cov, runs.cross_third)[len(component) - 2][f, layout.reports.index(t)]
        estimated = own[layout.components(len(component)).index(component)][good].mean()
        assert row["n"] == good.sum()
        assert row["names"] == " · ".join(layout.coordinates[i] for i in component)
        assert row["actual"] == pytest.approx(
            np.prod(x[list(component)], axis=0).mean(), rel=1e-10, abs=1e-13
        )
        assert row["estimated"] == pytest.approx(estimated, rel=1e-12)


def test_kept_runs_hold_what_each_filter_stated_of_its_error(sample):
    _, runs, totals = sample
    rows = summary.runs_table(totals)
    rows = rows[(rows["filter"] == "filter 2") & (rows["time"] == 1.5)]
    for name, given in (("", runs.error), ("_variance", runs.variance), ("_third", runs.third)):
        stated = given[1, 3, 1, : len(rows)]
        np.testing.assert_allclose(rows[f"velocity{name}"], stated, rtol=1e-6 if name else 0)


def test_the_standard_error_of_an_estimated_moment_is_that_of_a_mean_over_the_runs_that_are_left():
    layout = made_runs.layout(filters=2)
    runs = made_runs.make(layout, 20_000, seed=15)
    good = ~made_runs.lost(runs, layout)[0, 3]
    stated = runs.cov[0, 1, 1][good]
    rows = moments_table(made_runs.total(runs, layout)).set_index(["filter", "time", "indices"])
    row = rows.loc[("filter 1", 1.5, "1,2")]
    # The jackknife over 64 groups knows a standard error to 9 %.
    assert row["estimated_stderr"] == pytest.approx(stated.std() / np.sqrt(len(stated)), rel=0.3)


def test_diagonal_moments_are_those_of_the_statistics(sample):
    moments = moments_table(sample[2]).set_index(["filter", "time", "indices"])
    rows = made_runs.keyed(summary.statistics_table(sample[2]))
    for indices, coordinate, statistic in (
        ("1,1", "position", "variance_actual"),
        ("2,2", "velocity", "variance_actual"),
        ("2,2,2", "velocity", "third_actual"),
    ):
        own, row = moments.loc[("filter 1", 1.5, indices)], rows["filter 1", "1.5", coordinate, statistic]
        assert own["actual"] == pytest.approx(row.value, rel=1e-12)
        assert own["stderr"] == pytest.approx(row.stderr, rel=1e-9)


@pytest.mark.parametrize("runs", [600, 3000], ids=["delta", "jackknife"])
def test_standard_errors_of_cross_moments_and_differences_equal_the_spread_over_repetitions(runs):
    layout = made_runs.layout(filters=2, times=200)._replace(reports=tuple(range(200)))
    totals = made_runs.total(made_runs.make(layout, runs, seed=12, lost=0.0), layout)
    moments, paired = moments_table(totals), paired_table(totals)
    groups = [
        moments[(moments["filter"] == "filter 1") & (moments["indices"] == i)] for i in ("1,2", "1,1,2")
    ]
    columns = ["actual", "actual"]
    for statistic in ("rms", "rms_clipped", "mean_error"):
        for coordinate in ("velocity", "both") if statistic != "mean_error" else ("velocity",):
            groups.append(paired[(paired["statistic"] == statistic) & (paired["coordinate"] == coordinate)])
            columns.append("difference")
    for rows, column in zip(groups, columns, strict=True):
        assert len(rows) == 200
        # The spread of 200 values is itself known to 5 %.
        assert np.sqrt(np.mean(rows["stderr"] ** 2)) == pytest.approx(rows[column].std(), rel=0.2)


def test_paired_differences_equal_numpy_over_the_runs_that_both_survive(sample):
    layout, runs, totals = sample
    bad = made_runs.lost(runs, layout)
    rows = paired_table(totals)
    assert len(rows) == 3 * 2 * (3 + 3 + 2)
    assert list(dict.fromkeys(zip(rows["filter_a"], rows["filter_b"], strict=True))) == [
        ("filter 1", "filter 2"),
        ("filter 1", "filter 3"),
        ("filter 2", "filter 3"),
    ]
    for row in rows.itertuples():
        a, b = layout.filters.index(row.filter_a), layout.filters.index(row.filter_b)
        t = layout.times.index(row.time)
        both = ~(bad[a, t] | bad[b, t])
        sizes = [made_runs.magnitude(runs, layout, f, t, row.coordinate) for f in (a, b)]
        if row.statistic == "rms":
            values, n = [np.sqrt(np.mean(size[both] ** 2)) for size in sizes], both.sum()
        elif row.statistic == "rms_clipped":
            bound = made_runs.clip(layout, row.coordinate)
            capped = [
                np.where(bad[f, t], bound, np.minimum(size, bound))
                for f, size in zip((a, b), sizes, strict=True)
            ]
            values, n = [np.sqrt(np.mean(size**2)) for size in capped], len(both)
        else:
            c = layout.coordinates.index(row.coordinate)
            values, n = [runs.error[f, t, c, both].mean() for f in (a, b)], both.sum()
        assert row.n == n
        assert row.difference == pytest.approx(values[0] - values[1], rel=1e-9, abs=1e-13)
        assert 0 <= row.p_value <= 1


def test_pairing_makes_a_difference_far_more_certain_than_independent_runs_would():
    layout = made_runs.layout(filters=2)
    table = summary.tables(made_runs.total(made_runs.make(layout, 3000, seed=13, lost=0.0), layout))
    rms = made_runs.keyed(table["statistics"])
    separate = np.hypot(*(rms[label, "1.5", "position", "rms"].stderr for label in layout.filters))
    paired = table["paired"].query("time == 1.5 and coordinate == 'position' and statistic == 'rms'")
    assert paired["stderr"].item() < 0.75 * separate


def test_a_single_filter_has_no_pairs_but_the_columns():
    layout = made_runs.layout(filters=1)
    table = paired_table(made_runs.total(made_runs.make(layout, 64, seed=14), layout))
    assert len(table) == 0
    assert "p_value" in table.columns


def test_divergence_counts_runs_lost_at_any_report_time(sample):
    layout, runs, totals = sample
    bad = made_runs.lost(runs, layout)[:, list(layout.reports)]
    table = summary.divergence_table(totals)
    count = runs.error.shape[-1]
    for f, row in enumerate(table.itertuples()):
        ever = bad[f].any(axis=0)
        first = np.array(layout.report_times)[bad[f].argmax(axis=0)[ever]]
        assert (row.filter, row.n, row.diverged) == (layout.filters[f], count, ever.sum())
        assert row.fraction == pytest.approx(ever.mean(), rel=1e-14)
        assert row.low < row.fraction < row.high
        assert row.first_time_median == np.median(first)
        assert row.guarded == runs.guarded[f].sum()
        assert row.guarded_fraction == pytest.approx(runs.guarded[f].mean() / 7, rel=1e-14)


def test_a_filter_that_never_diverges_has_no_first_time_and_an_interval_from_zero():
    layout = made_runs.layout(filters=1)
    row = summary.divergence_table(
        made_runs.total(made_runs.make(layout, 100, seed=15, lost=0.0), layout)
    ).iloc[0]
    assert (row["diverged"], row["low"]) == (0, 0.0)
    assert 0.03 < row["high"] < 0.04
    assert np.isnan(row["first_time_median"])


@pytest.mark.parametrize(("flags", "median"), [([1, 0], 0.5), ([0, 1], 1.5), ([1, 1], 1.0), ([2, 1], 0.5)])
def test_the_median_first_time_is_that_of_the_lost_runs(flags, median):
    layout = made_runs.layout(filters=1)
    runs = made_runs.make(layout, 64, seed=16, lost=0.0)
    early, late = flags
    runs.diverged[0, 1, :early] = True
    runs.diverged[0, 3, : early + late] = True
    row = summary.divergence_table(made_runs.total(runs, layout)).iloc[0]
    assert row["diverged"] == early + late
    assert row["first_time_median"] == median


@pytest.mark.parametrize("keep", [0, 5, 100, 20_000])
def test_kept_runs_are_the_first_ones_as_they_were(keep):
    layout = made_runs.layout(filters=2, keep_runs=keep)
    runs = made_runs.make(layout, 200, seed=17, lost=0.0)
    runs.diverged[1, 3, 2] = True
    table = summary.runs_table(made_runs.total(runs, layout))
    count = min(keep, 200)
    assert len(table) == 2 * 2 * count
    for f, t in ((0, 1), (1, 3)):
        rows = table[(table["filter"] == layout.filters[f]) & (table["time"] == layout.times[t])]
        assert rows["run"].tolist() == list(range(count))
        np.testing.assert_array_equal(rows["velocity"], runs.error[f, t, 1, :count])
        np.testing.assert_array_equal(rows["diverged"], runs.diverged[f, t, :count])


def test_tables_are_the_same_in_every_bit_when_made_twice(sample):
    first, second = summary.tables(sample[2]), summary.tables(sample[2].copy())
    for name, table in first.items():
        pd.testing.assert_frame_equal(table, second[name], check_exact=True)
