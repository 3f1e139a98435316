"""Standard errors are right: by textbook formulas, against each other, and by how often intervals cover."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from nlbench.statistics.summary import statistics_table
from nlbench.statistics.uncertainty import jackknife, p_value, wilson
from tests.statistics import made_runs

STATISTICS = ["rms", "mean_error", "variance_actual", "third_actual"]


def mean(sums):
    return sums["x"] / sums["n"]


def test_the_jackknife_of_a_mean_over_equal_groups_is_the_textbook_formula():
    groups = np.random.default_rng(1).normal(size=40)
    sums = {"x": 10 * groups, "n": np.full(40, 10.0)}
    assert jackknife(mean, sums, sums["n"]) == pytest.approx(groups.std(ddof=1) / np.sqrt(40), rel=1e-12)


def test_the_jackknife_of_a_mean_over_unequal_groups_is_unbiased():
    rng = np.random.default_rng(2)
    size = rng.integers(20, 200, 64).astype(float)
    repetitions = 4000
    sums = {
        "x": size[:, None] * 3 + rng.normal(size=(64, repetitions)) * np.sqrt(size)[:, None],
        "n": np.repeat(size[:, None], repetitions, axis=1),
    }
    variance = jackknife(mean, sums, sums["n"]) ** 2
    # The mean of 4000 variances with 63 degrees of freedom is known to 0.3 %.
    assert variance.mean() == pytest.approx(1 / size.sum(), rel=0.012)


def test_the_jackknife_of_unequal_groups_equals_a_worked_example():
    """The square of a mean over groups of 1, 1 and 2 runs that sum to 0, 2 and 6.

    Whole 4, without each group 64/9, 4, 1; h = 4, 4, 2; pseudo-values 16 - 64/3 = -16/3, 4, 7; the jackknife
    estimate is 12 - 3/4 64/9 - 3/4 4 - 1/2 = 19/6; the variance (289/4 / 3 + 25/36 / 3 + 529/36) / 3 = 4213/324.
    """
    sums = {"x": np.array([0.0, 2.0, 6.0]), "n": np.array([1.0, 1.0, 2.0])}
    stderr = jackknife(lambda part: (part["x"] / part["n"]) ** 2, sums, sums["n"])
    assert stderr**2 == pytest.approx(4213 / 324, rel=1e-12)


def test_the_jackknife_passes_over_empty_groups_and_gives_nan_for_a_single_one():
    values = np.random.default_rng(3).normal(size=40)
    full = {"x": values, "n": np.ones(40)}
    gaps = {"x": np.append(values, np.zeros(24)), "n": np.append(np.ones(40), np.zeros(24))}
    assert jackknife(mean, gaps, gaps["n"]) == pytest.approx(jackknife(mean, full, full["n"]), rel=1e-13)
    assert np.isnan(jackknife(mean, {"x": np.ones(1), "n": np.ones(1)}, np.ones(1)))


@pytest.mark.parametrize("statistic", STATISTICS)
def test_jackknife_and_delta_method_agree_on_independent_runs(statistic, monkeypatch):
    layout = made_runs.layout(filters=1, times=60, clip=(1.5,))
    totals = made_runs.total(made_runs.make(layout, 64 * 100, seed=4, lost=0.0), layout)
    by_jackknife = statistics_table(totals)
    monkeypatch.setattr("nlbench.statistics.uncertainty.JACKKNIFE_GROUPS", 65)
    by_delta = statistics_table(totals)
    chosen = (by_delta["statistic"] == statistic) & (by_delta["time"] != "all")
    squares = [np.mean(table.loc[chosen, "stderr"] ** 2) for table in (by_jackknife, by_delta)]
    assert not np.isclose(*squares, rtol=1e-6)
    # Each jackknife variance is known to 18 %, the mean over 60 times to 2.3 %.
    assert squares[0] == pytest.approx(squares[1], rel=0.08)


@pytest.mark.parametrize("runs", [1000, 40 * 64], ids=["delta", "jackknife"])
def test_intervals_cover_the_truth_as_often_as_they_say(runs):
    """2000 times stand for repetitions; e = a + b x + c (x^2 - 1), x standard normal, is nearly Gaussian."""
    layout = made_runs.layout(filters=1, times=2001, clip=(3.0,))
    a, b, c = 0.2, 1.0, 0.03
    x = np.random.default_rng(runs).normal(size=(1, 2001, 1, runs))
    zeros = np.zeros_like(x)
    made = made_runs.Runs(
        error=a + b * x + c * (x**2 - 1),
        variance=zeros + 1.0,
        third=zeros,
        nees=zeros[:, :, 0],
        cov=zeros[:, :2],
        cross_third=zeros[:, :2],
        diverged=zeros[:, :, 0] > 0,
        guarded=np.zeros((1, runs), int),
        nis=zeros[:, :, 0],
        samples=np.zeros((1, 2001, runs), int),
        left_out=np.zeros((1, 2001, runs), int),
        log_likelihood=zeros[:, :, 0],
        invalid=np.zeros((1, 2001, runs), int),
    )
    variance = b**2 + 2 * c**2
    truth = {
        "mean_error": a,
        "variance_actual": variance,
        "rms": np.sqrt(a**2 + variance),
        "third_actual": 6 * b**2 * c + 8 * c**3,
    }
    table = statistics_table(made_runs.total(made, layout))
    table = table[table["time"] != "all"]
    for statistic, value in truth.items():
        rows = table[table["statistic"] == statistic]
        covered = np.mean(np.abs(rows["value"] - value) < 1.96 * rows["stderr"])
        assert 0.93 < covered < 0.97, statistic


@pytest.mark.parametrize(("count", "n"), [(0, 10), (1, 10), (37, 100_000), (50, 100), (100, 100), (0, 1)])
def test_wilson_interval_equals_scipy(count, n):
    expected = stats.binomtest(count, n).proportion_ci(0.95, method="wilson")
    low, high = wilson(np.array([count]), n)
    assert low[0] == pytest.approx(expected.low, rel=1e-9, abs=1e-15)
    assert high[0] == pytest.approx(expected.high, rel=1e-9)


def test_wilson_interval_equals_printed_values():
    """Newcombe (1998), table I: 81/263 and 15/148, 95 %, without continuity correction."""
    low, high = wilson(np.array([81]), 263)
    assert (round(float(low[0]), 4), round(float(high[0]), 4)) == (0.2553, 0.3662)
    low, high = wilson(np.array([15]), 148)
    assert (round(float(low[0]), 4), round(float(high[0]), 4)) == (0.0624, 0.1605)


@pytest.mark.parametrize("z", [0.0, 0.5, -1.96, 8.0, 30.0])
def test_p_value_is_two_sided_normal(z):
    assert p_value(2 * z, 2.0) == pytest.approx(2 * stats.norm.sf(abs(z)), rel=1e-12)


def test_p_value_without_spread_or_without_data():
    assert p_value(0.0, 0.0) == 1
    assert p_value(-1e-9, 0.0) == 0
    assert np.isnan(p_value(np.nan, 1.0))
    assert np.isnan(p_value(1.0, np.nan))
    assert np.isnan(p_value(-np.inf, np.inf))
