"""Claim: filters reproduce published and independently re-measured errors of problems from the literature.

The published ones are of Hartikainen, Solin and Sarkka 2011, tables 3.2-3.4: means over runs of a run's mean squared
error, or of its root. Their standard errors are those of as many runs of ours. Unscented filters have kappa = 3 - n;
with 0 they are the cubature filter.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.discrete.problems import BEARINGS_ONLY, REENTRY, UNGM, squared_errors

pytestmark = pytest.mark.long

PUBLISHED_RUNS = 100


def measured(errors, root):
    """Mean over runs, its standard error, and the standard deviation of a run: of mean squared errors, or of roots."""
    runs = errors.mean(1)
    runs = np.sqrt(runs) if root else runs
    deviation = runs.std(ddof=1)
    return runs.mean(), deviation / np.sqrt(len(runs)), deviation


def assert_near(errors, value, stderr=None, runs=PUBLISHED_RUNS, root=False):
    """Within 4 standard errors, of ours and theirs together; theirs is given, or that of their number of runs."""
    mean, own, deviation = measured(errors, root)
    theirs = deviation / np.sqrt(runs) if stderr is None else stderr
    assert abs(mean - value) < 4 * np.hypot(own, theirs), (mean, own, value, theirs)


@cache
def growth():
    filters = {"ekf": {}, "ckf": {}, "ghkf": {"points": 10}, "bootstrap": {"particles": 1000}}
    return squared_errors(UNGM, filters, runs=200, seed=1)


@cache
def bearings():
    filters = {"ekf": {}, "ukf": {"kappa": -1.0}, "ckf": {}, "ghkf": {"points": 3}, "sof-gaussian": {}}
    return squared_errors(BEARINGS_ONLY, filters, runs=1000, seed=2)


@cache
def vehicle():
    filters = {"ekf": {}, "ukf": {"kappa": -2.0}, "ckf": {}, "ghkf": {"points": 3}}
    return squared_errors(REENTRY, filters, runs=100, seed=3)


@pytest.mark.parametrize(
    ("name", "published"), [("ekf", 125.9), ("ckf", 72.3), ("ghkf", 40.9), ("bootstrap", 10.2)]
)
def test_mean_squared_errors_of_the_growth_model_are_the_published_ones(name, published):
    assert_near(growth()[name], published)


@pytest.mark.parametrize(
    ("name", "value", "stderr"), [("ekf", 119.9, 2.6), ("ckf", 72.7, 0.7), ("ghkf", 42.0, 0.4)]
)
def test_mean_squared_errors_of_the_growth_model_are_the_re_measured_ones(name, value, stderr):
    assert_near(growth()[name], value, stderr)


def test_a_thousand_particles_are_nearly_exact_on_the_growth_model():
    """Against the exact filter's error, which 800 runs of a grid filter in NumPy put at 10.13 +- .06, and the bootstrap
    filter's above it, on the same runs, at .06 +- .013."""
    assert_near(growth()["bootstrap"], 10.19, 0.066)


@pytest.mark.parametrize(("name", "published"), [("ekf", 0.114), ("ukf", 0.113)])
def test_position_errors_of_bearings_only_are_the_published_ones_of_1000_runs(name, published):
    assert_near(bearings()[name], published, runs=1000, root=True)


@pytest.mark.parametrize(("name", "published"), [("ckf", 0.1078), ("ghkf", 0.1072)])
def test_position_errors_of_bearings_only_are_the_published_ones_of_100_runs(name, published):
    """The table's .108 and .107 with the digits of the manual's source; the same runs put the UKF at .1066, which 1,000
    put at .113: they were runs with small errors."""
    assert_near(bearings()[name], published, root=True)


@pytest.mark.parametrize(("name", "value"), [("ekf", 0.1132), ("ckf", 0.1130), ("ghkf", 0.1127)])
def test_position_errors_of_bearings_only_are_those_of_filters_written_in_numpy(name, value):
    """1,000 runs of another program, which shares nothing with this one."""
    assert_near(bearings()[name], value, 0.0009, root=True)


def test_position_error_of_the_right_second_order_filter_is_the_re_measured_one():
    """.1104 +- .0011; the published .202 is that of a wrong Hessian."""
    assert_near(bearings()["sof-gaussian"], 0.1104, 0.0011, root=True)


@pytest.mark.parametrize("name", ["ekf", "ukf", "ckf", "ghkf"])
def test_position_errors_of_the_vehicle_are_the_published_ones(name):
    """In km; re-measured for the EKF."""
    published = {"ekf": 0.008385, "ukf": 0.008384, "ckf": 0.008384, "ghkf": 0.008383}[name]
    assert_near(vehicle()[name], published, root=True)
    assert_near(vehicle()["ekf"], 0.00842, 0.00006, root=True)


def test_filters_of_the_vehicle_differ_by_less_than_a_thousandth():
    """On the same runs, as the published digits do."""
    means = [measured(errors, True)[0] for errors in vehicle().values()]
    assert max(means) < 1.001 * min(means)
