"""Claim: the reference of a linear system is the Kalman filter, and no other system gets it."""

from __future__ import annotations

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench.errors import ConfigError
from nlbench.systems.exact import LinearGaussian

A, Q = np.array([[-0.3, 1.0], [-0.5, -0.2]]), np.array([[0.0, 0.0], [0.0, 0.6]])
INITIAL = nb.Moments([1.0, 0.5], [[0.7, 0.1], [0.1, 0.4]])
MOVING = nb.System(
    drift=lambda t, x: jnp.asarray(A) @ x,
    observe=lambda t, x: x[:1],
    measurement_cov=[[0.3]],
    initial=INITIAL,
    diffusion=lambda t, x: np.array([[0.0], [1.0]]),
    diffusion_cov=[[0.6]],
    step=0.01,
    exact=LinearGaussian(),
)
STEPPING = nb.DiscreteSystem(
    transition=lambda k, x, w: jnp.asarray(A) @ x + w,
    observe=lambda k, x, v: x[:1] + 2 * v,
    process_cov=Q,
    measurement_cov=[[0.3]],
    initial=INITIAL,
    exact=LinearGaussian(),
)


def corrected(m, P, y, R):
    H = np.array([[1.0, 0.0]])
    K = P @ H.T / (P[0, 0] + R)
    return m + K[:, 0] * (y - m[0]), P - K @ H @ P


def test_in_discrete_time_it_is_the_kalman_filter():
    f = nb.filters.build("exact", STEPPING)
    state, _ = f.update(f.predict(f.init(INITIAL), 0, 1), 1, jnp.array([0.8]))
    m, P = corrected(A @ INITIAL.mean, A @ INITIAL.cov @ A.T + Q, 0.8, 1.2)
    np.testing.assert_allclose(f.moments(state).mean, m, atol=1e-12)
    np.testing.assert_allclose(f.moments(state).cov, P, atol=1e-12)


def test_in_continuous_time_it_is_the_kalman_filter_to_the_accuracy_of_its_integration():
    """RK4 over 100 steps of .01 leaves some 1e-10."""
    f = nb.filters.build("exact", MOVING)
    state, _ = f.update(f.predict(f.init(INITIAL), 0.0, 1.0), 1.0, jnp.array([0.8]))

    def slope(t, y):
        P = y[2:].reshape(2, 2)
        return np.concatenate([A @ y[:2], (A @ P + P @ A.T + Q).ravel()])

    end = solve_ivp(slope, (0, 1), [1.0, 0.5, 0.7, 0.1, 0.1, 0.4], rtol=1e-12, atol=1e-13).y[:, -1]
    m, P = corrected(end[:2], end[2:].reshape(2, 2), 0.8, 0.3)
    np.testing.assert_allclose(f.moments(state).mean, m, atol=1e-9)
    np.testing.assert_allclose(f.moments(state).cov, P, atol=1e-9)


@pytest.mark.parametrize(
    ("message", "system"),
    [
        ("drift is not linear", replace(MOVING, drift=lambda t, x: -(x**3))),
        ("transition is not linear", replace(STEPPING, transition=lambda k, x, w: x * jnp.exp(w[0]))),
        ("observe is not linear", replace(STEPPING, observe=lambda k, x, v: x[:1] ** 2 + v)),
    ],
)
def test_refuses_what_is_not_linear(message, system):
    with pytest.raises(ConfigError, match=message):
        nb.filters.build("exact", system)
