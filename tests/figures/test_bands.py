"""Claim: bands have the width that statistics gives them, and axes show what is known."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.figures import bands, data, style
from tests import synthetic_run


def curve(value, stderr, n=10_000):
    value = np.asarray(value, float)
    return data.Curve(
        np.arange(len(value)), value, np.broadcast_to(stderr, value.shape), np.full(value.shape, n)
    )


def test_the_band_of_n_runs_is_that_of_gaussian_errors():
    """The RMS of N normal errors has relative standard deviation 1/sqrt(2 N): .85 to 1.15 for 80."""
    low, high = bands.of_runs(curve([1.0], 1 / np.sqrt(2 * 10_000)), 80)
    assert (low[0], high[0]) == pytest.approx((1 - 1.96 / np.sqrt(160), 1 + 1.96 / np.sqrt(160)), rel=1e-5)


def test_the_band_covers_what_resampled_runs_show():
    """Of the RMS errors of sets of 80 out of skewed errors, some 95 % lie in the band."""
    generator = np.random.default_rng(1)
    errors = generator.gamma(2.0, size=(2000, 80)) - 2.0
    squares = errors**2
    rms = np.sqrt(squares.mean())
    low, high = bands.of_runs(
        curve([rms], squares.std() / np.sqrt(squares.size) / (2 * rms), squares.size), 80
    )
    inside = np.mean((np.sqrt(squares.mean(1)) > low) & (np.sqrt(squares.mean(1)) < high))
    assert inside == pytest.approx(
        0.95, abs=0.03
    )  # the delta method for 80 skewed errors, not chance, limits this


def test_the_floor_cuts_the_band():
    low, _ = bands.of_runs(curve([0.1], 0.1), 80, floor=0.0)
    assert low[0] == 0.0


def test_a_mean_that_one_run_decides_does_not_stretch_the_axis():
    usual = np.linspace(0.1, 0.2, 20)
    shown = bands.steady([curve(usual, 0.001), curve([0.15, 50.0], np.array([0.001, 49.0]))])
    assert shown.max() == pytest.approx(0.2)


def test_limits_show_all_values_and_leave_them_half_the_height():
    values, wide = np.array([1.0, 1.2]), np.array([-5.0, 7.0])
    low, high = bands.limits(values, wide)
    assert low < 1.0 < 1.2 < high
    assert high - low == pytest.approx(0.4 * 1.1)
    assert bands.limits(np.array([np.nan]), wide) == (0.0, 1.0)
    assert bands.limits(np.array([1.0, 1.0]), np.empty(0))[0] < 1.0


def test_every_filter_has_a_look_of_its_own_without_colour():
    labels = tuple(f"filter {index}" for index in range(18))
    looks = style.looks((*labels, "exact"), "exact")
    assert len({(str(look.dash), look.marker) for look in looks.values()}) == 19


def test_without_a_reference_the_best_filter_is_the_baseline(tmp_path):
    factors = {"second-order": 1.2, "third-order": 1.1, "linearised-kalman": 1.3}
    assert data.read(synthetic_run.results(tmp_path, factors)).baseline == "third-order"


def test_units_are_raised_to_the_power_of_the_moment():
    assert style.with_unit("variance", "ft", 2) == "variance (ft²)"
    assert style.with_unit("third moment", "ft/s", 3) == "third moment ((ft/s)³)"
    assert style.with_unit("variance", "", 2) == "variance"
