"""Claim: state-dependent-noise has second moments that the truncated filter predicts exactly, and others do not."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
A, B0, B1 = 0.5, 1.0, 0.3


def build(**parameters):
    return nb.systems.build("state-dependent-noise", **parameters)


def test_chosen_values_are_the_defaults():
    system = build()
    assert (list(system.initial.mean), system.initial.cov) == ([0.0], [[2.0]])
    assert (system.process_cov, system.measurement_cov) == ([[1.0]], [[2.0]])
    x, w = jnp.array([2.0]), jnp.array([-0.5])
    np.testing.assert_allclose(system.transition(0, x, w), [1.0 - 0.5 * np.sqrt(2.2)], rtol=1e-15)
    np.testing.assert_allclose(system.observe(0, x, w), [1.5])


def test_the_grid_of_the_reference_resolves_the_least_noise_and_holds_all_but_rare_states():
    (lower,), (upper,), (points,) = build().exact
    assert (upper - lower) / (points - 1) == pytest.approx(0.5)  # of the least deviation, 1: two points in it
    states, _ = simulated(build(), 40, 40_000, seed=3)
    assert lower < states.min()
    assert states.max() < upper


@pytest.mark.parametrize(
    ("name", "noise"),
    [
        ("truncated", lambda m, P: B0 + B1 * (m**2 + P)),  # the exact E G(x)^2
        ("sof-gaussian", lambda m, P: B0 + B1 * m**2 + B1**2 * m**2 / (B0 + B1 * m**2) * P),  # G^2 + G'^2 P
        ("ekf", lambda m, P: B0 + B1 * m**2),
    ],
)
@pytest.mark.parametrize("m", [0.0, -1.7])
def test_predicted_variances(name, noise, m):
    system, P = build(), 0.8
    f = nb.filters.build(name, system)
    found = f.moments(f.predict(f.init(nb.Moments([m], [[P]])), 0, 1))
    np.testing.assert_allclose(found.mean, [A * m], atol=1e-15)
    np.testing.assert_allclose(found.cov, [[A**2 * P + noise(m, P)]], rtol=1e-13)


def test_the_exact_variance_is_that_of_the_truncated_filter():
    """By Gauss-Hermite quadrature over x and w, which is exact: E of b0 + b1 x^2, a polynomial."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    m, P, system = -1.7, 0.8, build()
    x = m + np.sqrt(P) * nodes
    moved = np.array([[system.transition(0, jnp.array([a]), jnp.array([b]))[0] for b in nodes] for a in x])
    mass = np.outer(weights, weights) / weights.sum() ** 2
    variance = (mass * moved**2).sum() - (mass * moved).sum() ** 2
    assert variance == pytest.approx(A**2 * P + B0 + B1 * (m**2 + P), rel=1e-12)


def test_the_state_is_stationary_with_variance_b0_over_one_minus_a2_minus_b1():
    states, _ = simulated(build(), 40, 40_000, seed=3)
    square = states[:, -1, 0] ** 2
    assert abs(square.mean() - B0 / (1 - A**2 - B1)) < 4 * square.std() / np.sqrt(len(square))


@pytest.mark.parametrize("name", ["ekf", "truncated", "sof-gaussian", "ukf"])
def test_filters_follow_it(name):
    system = build()
    states, seen = simulated(system, 20, 16, seed=1)
    means, covs = followed(name, system, seen)
    assert np.isfinite(covs).all()
    assert not np.any([system.diverged(each) for each in (states - means).reshape(-1, 1)])
    assert system.diverged(jnp.array([-21.0]))


@pytest.mark.parametrize(
    "bad",
    [
        {"coefficient": -1.0},
        {"base": 0.0},
        {"growth": -0.1},
        {"measurement_variance": 0.0},
        {"interval": 1.5},
        {"degrees": 5},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
