"""Claim: positiveness is the case in which the erroneous truncated filter predicts a negative variance."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
ERRONEOUS = ["truncated-jazwinski", "modified-jazwinski"]
# Variance that the square is predicted with, less that of its own noise: Q2 - (2 P)^2/4, Q2, Q2 + (2 P)^2/2 with P = 1.
ADDED = {"truncated-jazwinski": -1.0, "modified-jazwinski": -1.0, "truncated": 0.0, "sof-gaussian": 2.0}


def build(**parameters):
    return nb.systems.build("positiveness", **parameters)


def foretold(name, system):
    """Moments of a filter before the first measurement."""
    f = nb.filters.build(name, system)
    return f.moments(f.predict(f.init(system.initial), 0, 1))


def test_chosen_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, [0.0, 1.0])
    np.testing.assert_array_equal(system.initial.cov, [[1.0, 0.0], [0.0, 2.1]])
    np.testing.assert_allclose(system.process_cov, np.diag([0.36, 0.1]))
    np.testing.assert_array_equal(system.measurement_cov, [[2.0]])
    assert [each.name for each in system.coordinates] == ["signal", "square"]


def test_the_square_of_the_signal_is_seen_a_step_later():
    system, x, w = build(), jnp.array([3.0, 5.0]), jnp.array([0.5, -0.25])
    np.testing.assert_allclose(system.transition(0, x, w), [0.8 * 3 + 0.5, 9 - 0.25])
    np.testing.assert_allclose(system.observe(0, x, jnp.array([0.5])), [5.5])


def test_moments_of_the_square_are_those_of_a_standard_normal_signal():
    """The truth: the signal has variance 1 always, its square mean 1 and variance 2, and noise adds .1."""
    states, _ = simulated(build(), 30, 40_000, seed=5)
    for value, mean in (
        (states[:, -1, 0] ** 2, 1.0),
        (states[:, -1, 1], 1.0),
        ((states[:, -1, 1] - 1) ** 2, 2.1),
    ):
        assert abs(value.mean() - mean) < 4 * value.std() / np.sqrt(len(value))


@pytest.mark.parametrize("name", ADDED)
@pytest.mark.parametrize("detector", [0.0, 0.1])
def test_predicted_variances_are_minus_one_zero_and_two(name, detector):
    mean, cov = foretold(name, build(detector_variance=detector))[:2]
    np.testing.assert_array_equal(mean, [0.0, 1.0])
    np.testing.assert_allclose(cov, np.diag([1.0, detector + ADDED[name]]), rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", ADDED)
def test_the_variance_is_lost_at_every_step_or_never(name):
    """The estimate of the signal stays 0 and its variance 1, so that every step is like the first: the posterior
    variance is p - p^2/(p + 2) with p that predicted, negative for p = -.9."""
    system = build()
    _, seen = simulated(system, 20, 8, seed=1)
    means, covs = followed(name, system, seen)
    p = 0.1 + ADDED[name]
    np.testing.assert_allclose(means[..., 0], 0.0, atol=1e-15)
    expected = np.diag([1.0, p - p**2 / (p + 2)])
    np.testing.assert_allclose(covs, np.broadcast_to(expected, covs.shape), rtol=1e-12, atol=1e-14)
    assert (expected[1, 1] < 0) == (name in ERRONEOUS)


@pytest.mark.parametrize("name", ["ekf", "sof-gaussian", "ukf"])
def test_filters_follow_it(name):
    system = build()
    states, seen = simulated(system, 20, 16, seed=1)
    means, covs = followed(name, system, seen)
    assert np.isfinite(covs).all()
    assert not np.any([system.diverged(each) for each in (states - means).reshape(-1, 2)])
    assert system.diverged(jnp.array([0.0, -101.0]))


@pytest.mark.parametrize(
    "bad",
    [
        {"coefficient": 1.0},
        {"detector_variance": -0.1},
        {"measurement_variance": 0.0},
        {"interval": 0},
        {"curvature": 2.0},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
