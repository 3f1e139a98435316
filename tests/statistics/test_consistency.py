"""Chi-square quantiles are those of closed forms; a consistent filter is within its bounds as often as they say."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from nlbench.results.reasons import left_out
from nlbench.statistics.chi_square import quantile
from nlbench.statistics.consistency import COLUMNS, consistency_table, left_out_table
from nlbench.statistics.summary import statistics_table
from tests.statistics import made_runs


def exceeded(x, degrees):
    """Of one degree, the square of a normal variable; of 2 m, the Poisson probability of fewer than m at x/2."""
    if degrees == 1:
        return math.erfc(math.sqrt(x / 2))
    log_terms = (j * math.log(x / 2) - x / 2 - math.lgamma(j + 1) for j in range(degrees // 2))
    return math.fsum(map(math.exp, log_terms))


@pytest.mark.parametrize("probability", [1e-4, 0.025, 0.5, 0.975, 0.9999])
def test_quantiles_are_exceeded_as_often_as_they_say(probability):
    degrees = np.array([[1, 2, 4], [50, 1000, 40_000]])
    found = quantile(probability, degrees)
    assert found.shape == degrees.shape
    for x, k in zip(found.ravel(), degrees.ravel(), strict=True):
        assert exceeded(x, int(k)) == pytest.approx(1 - probability, rel=1e-9)


def test_quantiles_of_many_degrees_are_nearly_normal():
    k = 3e8
    bound = 1.959963984540054 * math.sqrt(2 * k)
    assert quantile(0.975, np.array([k]))[0] == pytest.approx(k + bound, rel=1e-8)


def test_nothing_has_no_quantile():
    assert np.isnan(quantile(0.5, np.array([0.0, np.nan]))).all()


def made(filters, times, runs, left_out=0, factor=1.0):
    """NEES and NIS that are chi-square times a factor, and the table that is made of them."""
    layout = made_runs.layout(filters=filters, times=times)
    invented = made_runs.make(layout, runs, seed=12, lost=0.0)
    rng = np.random.default_rng(7)
    samples = invented.samples
    invented = invented._replace(
        nees=factor * rng.chisquare(2, invented.nees.shape),
        nis=np.where(samples > 0, factor * rng.chisquare(np.maximum(3 * samples, 1)), 0.0),
        left_out=np.zeros_like(samples),
        invalid=np.zeros_like(samples),
    )
    invented.left_out[0, 1, :left_out] = 1
    totals = made_runs.total(invented, layout)
    statistics = statistics_table(totals)
    return layout, statistics, consistency_table(totals, statistics, measurements=3)


def test_a_consistent_filter_is_within_the_bounds_as_often_as_they_say():
    _, statistics, table = made(filters=1, times=601, runs=150)
    assert list(table.columns) == list(COLUMNS)
    for score, rows in table[table.time != "all"].groupby("score"):
        assert len(rows) == (601 if score == "nees" else 600)
        inside = rows.consistent.sum()
        assert abs(inside - 0.95 * len(rows)) < 4 * np.sqrt(0.95 * 0.05 * len(rows))
        np.testing.assert_allclose(rows.low, stats.chi2.ppf(0.025, rows.n * rows.dof) / rows.n, rtol=1e-9)
        np.testing.assert_allclose(rows.high, stats.chi2.ppf(0.975, rows.n * rows.dof) / rows.n, rtol=1e-9)
        assert set(rows.dof) == ({2} if score == "nees" else {3})
    own = statistics[(statistics.coordinate == "all") & (statistics.statistic == "nis")]
    np.testing.assert_array_equal(table[table.score == "nis"].value, own.value)
    np.testing.assert_array_equal(table[table.score == "nis"].n, own.n)


@pytest.mark.parametrize("factor", [0.7, 1.4])
def test_a_filter_that_misjudges_itself_is_found_out(factor):
    *_, table = made(filters=2, times=3, runs=2000, factor=factor)
    assert not table.consistent.any()
    assert (table.value < table.low).all() if factor < 1 else (table.value > table.high).all()


def test_a_selection_of_samples_has_no_bounds():
    *_, table = made(filters=2, times=3, runs=300, left_out=1)
    table = table.set_index(["filter", "score", "time"])
    for time in ("0.5", "all"):
        row = table.loc["filter 1", "nis", time]
        assert np.isnan([row.low, row.high]).all()
        assert row.consistent is pd.NA
    others = table.drop([("filter 1", "nis", time) for time in ("0.5", "all")])
    assert others.consistent.notna().all()
    assert others.low.notna().all()


def test_what_is_left_out_is_counted_by_its_reason():
    """Of the runs that are not lost at a time, and of those that never are; against a plain count."""
    layout = made_runs.layout(filters=2, times=3)
    invented = made_runs.make(layout, 300, seed=12)
    table = left_out_table(made_runs.total(invented, layout)).set_index(["filter", "time"])
    lost = made_runs.lost(invented, layout)
    for f, label in enumerate(layout.filters):
        for times, time in (([1], "0.5"), ([2], "1.0"), ([1, 2], "all")):
            kept = ~(lost[f].any(0) if time == "all" else lost[f, times[0]])
            for name, counted in (("limited_or_guarded", "left_out"), ("invalid", "invalid")):
                expected = getattr(invented, counted)[f, times][:, kept].sum()
                assert table.loc[(label, time), name] == expected > 0


def test_limited_is_not_said_of_what_had_no_valid_covariance():
    assert left_out({"limited_or_guarded": 0, "invalid": 340}) == "340 without a valid covariance"
    both = {"limited_or_guarded": 12, "invalid": 3400}
    assert left_out(both) == "12 limited or guarded and 3,400 without a valid covariance"


def test_the_table_survives_both_formats(tmp_path):
    from nlbench.results.tables import csv_bytes, parquet_bytes, read_parquet

    *_, table = made(filters=1, times=2, runs=100, left_out=1)
    back = read_parquet(parquet_bytes(table))
    pd.testing.assert_series_equal(back.value, table.value)
    assert [None if pd.isna(x) else bool(x) for x in back.consistent] == [
        None if pd.isna(x) else bool(x) for x in table.consistent
    ]
    assert ",True\n" in csv_bytes(table).decode()
