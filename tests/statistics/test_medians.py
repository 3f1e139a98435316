"""Medians from the histogram agree with exact ones far within their standard error."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.statistics import histogram
from nlbench.statistics.medians import medians
from tests.statistics import made_runs


def test_the_histogram_median_errs_by_far_less_than_its_standard_error():
    layout = made_runs.layout(filters=2)
    few_kept = layout._replace(keep_runs=0)
    runs = made_runs.make(layout, 20_000, seed=1)
    exact = medians(made_runs.total(runs, layout))
    streamed = medians(made_runs.total(runs, few_kept))
    assert not np.array_equal(exact.value, streamed.value)
    # Where in its bin the median lies is uncertain by sqrt(share of the runs in the bin) / 2 standard errors.
    assert (np.abs(streamed.value - exact.value) < 0.2 * exact.stderr).all()
    assert np.sqrt(np.mean(((streamed.value - exact.value) / exact.stderr) ** 2)) < 0.05
    np.testing.assert_allclose(streamed.stderr, exact.stderr, rtol=0.1)


def test_a_lost_run_counts_as_infinite():
    layout = made_runs.layout(filters=1, clip=(1.0,))
    runs = made_runs.make(layout, 101, seed=2, lost=0.0)
    runs.error[0, 1, 0] = np.arange(101) / 100
    runs.diverged[0, 1, :20] = True
    estimate = medians(made_runs.total(runs, layout))
    assert estimate.value[0, 0, 0] == 0.7
    runs.diverged[0, 1, :60] = True
    assert medians(made_runs.total(runs, layout)).value[0, 0, 0] == np.inf


def test_the_standard_error_equals_the_spread_over_repetitions():
    layout = made_runs.layout(filters=1, times=300, clip=(1.0,))._replace(reports=tuple(range(300)))
    runs = made_runs.make(layout, 400, seed=3, lost=0.0)
    estimate = medians(made_runs.total(runs, layout))
    assert np.sqrt(np.mean(estimate.stderr**2)) == pytest.approx(estimate.value.std(), rel=0.15)


def test_the_median_of_a_norm_is_that_of_the_norm():
    layout = made_runs.layout(filters=1)
    runs = made_runs.make(layout, 200, seed=4, lost=0.0)
    estimate = medians(made_runs.total(runs, layout))
    assert estimate.coordinates == ("position", "velocity", "both")
    expected = np.median(np.linalg.norm(runs.error[0, layout.reports[1]], axis=0))
    assert estimate.value[0, 1, 2] == pytest.approx(expected, rel=1e-14)


def test_every_number_lies_between_the_edges_of_its_bin():
    edges = histogram.edges()
    rng = np.random.default_rng(5)
    sizes = np.concatenate([2.0 ** rng.uniform(-45, 20, 10_000), edges[:-1], [0.0, 5e-324, 1e300]])
    bins = histogram.bin_of(sizes)
    assert len(edges) == histogram.BINS + 1
    assert (edges[bins] <= sizes).all()
    assert (sizes < edges[bins + 1]).all()
    assert histogram.bin_of(np.array([np.inf]))[0] == histogram.BINS - 1


def test_bins_inside_the_range_are_at_most_a_64th_of_their_value_wide():
    edges = histogram.edges()[1:-1]
    widths = np.diff(edges) / edges[:-1]
    assert widths.max() <= 1 / 64
    assert widths.min() > 1 / 129


def test_quantiles_of_evenly_filled_bins_are_linear():
    counts = np.zeros((2, histogram.BINS), np.int64)
    start = histogram.bin_of(np.array([1.0]))[0]
    counts[0, start : start + 64] = 10  # uniform over [1, 2)
    counts[1, -1] = 3
    np.testing.assert_allclose(histogram.quantile(counts, 0.5), [1.5, np.inf])
    assert histogram.quantile(counts, 0.25)[0] == pytest.approx(1.25)
    assert np.isnan(histogram.quantile(np.zeros((1, histogram.BINS)), 0.5)).all()
