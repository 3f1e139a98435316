"""The streamed table of statistics equals plain NumPy over all runs at once."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nlbench.statistics.consistency import consistency_table
from nlbench.statistics.summary import STATISTICS, statistics_table, tables
from tests.statistics import made_runs


@pytest.fixture(scope="module")
def table(sample) -> pd.DataFrame:
    return statistics_table(sample[2])


def test_has_the_columns_of_the_contract(table):
    assert list(table.columns) == ["filter", "time", "coordinate", "statistic", "value", "stderr", "n"]
    assert table["n"].dtype == np.int64
    assert table["time"].map(type).eq(str).all()
    assert set(table["time"]) == {"0.0", "0.5", "1.0", "1.5", "all"}


def test_every_value_and_count_equals_numpy_over_all_runs(sample, table):
    layout, runs, _ = sample
    expected = made_runs.statistics(runs, layout)
    rows = made_runs.keyed(table)
    assert rows.keys() == expected.keys()
    for key, (value, n) in expected.items():
        assert rows[key].n == n, key
        assert rows[key].value == pytest.approx(value, rel=1e-11, abs=1e-13), key


def test_rows_follow_filters_times_coordinates_and_statistics(sample, table):
    layout, _, _ = sample
    names = {
        "filter": layout.filters,
        "time": [*map(repr, layout.times), "all"],
        "coordinate": [*layout.magnitudes, "all"],
        "statistic": STATISTICS,
    }
    keys = list(zip(*(table[column].map(list(order).index) for column, order in names.items()), strict=True))
    assert keys == sorted(set(keys))


def test_rms_squared_is_mean_squared_plus_variance(table):
    rows = made_runs.keyed(table)
    at = [key[:3] for key in rows if key[3] == "mean_error"]
    assert len(at) == 3 * 4 * 2
    for key in at:
        rms, mean, variance = (rows[*key, name].value for name in ("rms", "mean_error", "variance_actual"))
        assert rms**2 == pytest.approx(mean**2 + variance, rel=1e-13)


@pytest.mark.parametrize(
    "statistic", ["rms", "mean_error", "variance_actual", "third_actual", "rms_clipped", "nees"]
)
@pytest.mark.parametrize("runs", [1000, 20_000], ids=["delta", "jackknife"])
def test_standard_errors_equal_the_spread_over_repetitions(statistic, runs):
    """Two hundred times stand for repetitions: their runs are independent of each other."""
    layout = made_runs.layout(filters=1, times=200, clip=(1.2,))
    table = statistics_table(made_runs.total(made_runs.make(layout, runs, seed=8, lost=0.0), layout))
    rows = table[
        (table["statistic"] == statistic) & (table["coordinate"] == "position") & (table["time"] != "all")
    ]
    spread = rows["value"].std()
    # The spread of 200 values is itself known to 5 %.
    assert np.sqrt(np.mean(rows["stderr"] ** 2)) == pytest.approx(spread, rel=0.2)


def test_the_delta_method_of_an_average_is_the_standard_error_of_the_mean():
    layout = made_runs.layout()
    runs = made_runs.make(layout, 500, seed=500)
    rows = made_runs.keyed(statistics_table(made_runs.total(runs, layout)))
    bad = made_runs.lost(runs, layout)
    for f, t, c in np.ndindex(3, 4, 2):
        e, v, s = (array[f, t, c, ~bad[f, t]] for array in (runs.error, runs.variance, runs.third))
        inside = (v > 0) & (np.abs(e) <= 1.959964 * np.sqrt(np.abs(v)))
        samples = {
            "mean_error": e,
            "variance_estimated": v,
            "third_estimated": s,
            "nees": e[v > 0] ** 2 / v[v > 0],
            "coverage_95": inside,
        }
        at = layout.filters[f], repr(layout.times[t]), layout.coordinates[c]
        for statistic, sample in samples.items():
            expected = np.std(sample, ddof=1) / np.sqrt(len(sample))
            assert rows[*at, statistic].stderr == pytest.approx(expected, rel=1e-9), statistic


def test_a_filter_that_diverges_at_once_gives_nan_and_zero_runs_and_leaves_the_others_alone():
    layout = made_runs.layout()
    runs = made_runs.make(layout, 300, seed=9)
    before = made_runs.keyed(statistics_table(made_runs.total(runs, layout)))
    runs.diverged[1] = True
    runs.error[1] = np.nan
    after = made_runs.keyed(statistics_table(made_runs.total(runs, layout)))
    for key, row in after.items():
        if key[0] != "filter 2":
            assert row == before[key]._replace(Index=row.Index)
        elif key[3] == "rms":
            assert row.n == 0
            assert np.isnan(row.value)
            assert np.isnan(row.stderr)
        elif key[3] == "rms_clipped":
            assert row.value == pytest.approx(made_runs.clip(layout, key[2]))
            assert row.stderr == 0
        elif key[3] == "median_error":
            assert row.value == np.inf
        elif key[3] == "diverged":
            assert (row.value, row.n) == (1.0, 300)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("runs", [100, 40 * made_runs.LANES])
def test_errors_at_the_end_of_what_numbers_hold_make_tables_without_a_warning(runs):
    layout = made_runs.layout()
    made = made_runs.make(layout, runs, seed=12, lost=0.0)
    most = np.finfo(float).max ** (1 / 6)
    made.error[1] *= (
        0.999 * most / np.abs(made.error[1]).max()
    )  # each sixth power is a number, their sum is none
    made.error[2] *= 1e160  # lost, but for the runs that are almost exact
    totals = made_runs.total(made, layout)
    consistency_table(totals, tables(totals)["statistics"], 2)
    rows = made_runs.keyed(tables(totals)["statistics"])
    plain = np.sqrt(np.mean((made.error[1, 2, 0] / most) ** 2)) * most
    assert rows["filter 2", "1.0", "position", "rms"].value == pytest.approx(plain, rel=1e-9)
    assert rows["filter 3", "1.0", "all", "diverged"].value > 0.99


def test_one_run_has_values_but_no_standard_errors():
    layout = made_runs.layout(filters=1)
    table = statistics_table(made_runs.total(made_runs.make(layout, 1, seed=10, lost=0.0), layout))
    moments = table[table["statistic"].isin(["rms", "mean_error", "variance_actual"])]
    assert moments["value"].notna().all()
    assert moments["stderr"].isna().all()


def test_without_a_clip_a_diverged_run_makes_the_clipped_error_infinite():
    layout = made_runs.layout(clip=(np.inf, 2.0))
    runs = made_runs.make(layout, 100, seed=11, lost=0.0)
    runs.diverged[0, 2, 3] = True
    rows = made_runs.keyed(statistics_table(made_runs.total(runs, layout)))
    assert rows["filter 1", "1.0", "position", "rms_clipped"].value == np.inf
    assert np.isfinite(rows["filter 1", "1.0", "velocity", "rms_clipped"].value)
    plain = np.sqrt(np.mean(runs.error[1, 2, 0] ** 2))
    assert rows["filter 2", "1.0", "position", "rms_clipped"].value == pytest.approx(plain, rel=1e-12)
