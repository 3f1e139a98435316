"""Claim: bearings-only has a target that turns right three times and filters that think it goes straight."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm

import nlbench as nb
from nlbench.errors import ConfigError

RATE = np.pi / 2 / 51 / 0.01
SENSORS = [(-1.0, -2.0), (1.0, 1.0)]


def build(**parameters):
    return nb.systems.build("bearings-only", **parameters)


def course(steps, noise=0.0):
    """States 1 ... steps of the target; with `noise` in every turn."""
    truth = build().truth

    def advance(x, k):
        x = truth.transition(k, x, jnp.array([noise]))
        return x, x

    start = truth.initial.mean
    return np.asarray(jax.lax.scan(advance, jnp.asarray(start), jnp.arange(steps))[1])


def test_the_target_follows_the_printed_turns():
    """By matrix exponentials: v' = a (v_y, -v_x), with a in steps 50-100, 200-250 and 350-400, counted from 1."""
    a = np.zeros(500)
    for first, last in ((50, 100), (200, 250), (350, 400)):
        a[first - 1 : last] = RATE + 0.02
    x, expected = np.array([0.0, 0.0, 1.0, 0.0]), []
    for rate in a:
        F = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, rate], [0, 0, -rate, 0]])
        x = expm(F * 0.01) @ x
        expected.append(x)
    np.testing.assert_allclose(course(500, 0.02), expected, atol=1e-12)


def test_three_right_angles_at_constant_speed():
    x = course(500)
    np.testing.assert_allclose(np.hypot(x[:, 2], x[:, 3]), 1.0, rtol=1e-12)
    for step, velocity in ((49, (1, 0)), (100, (0, -1)), (250, (-1, 0)), (400, (0, 1)), (500, (0, 1))):
        np.testing.assert_allclose(x[step - 1, 2:], velocity, atol=1e-12)


def test_filters_think_of_a_velocity_driven_by_white_noise():
    """Transition expm(F dt), and Q = integral of expm(F s) diag(0, 0, q, q) expm(F s)'."""
    system = build(process_psd=0.3)
    F = np.eye(4, k=2)
    x, w = np.array([0.3, -0.4, 1.5, 2.0]), np.array([1e-3, 2e-3, -1e-3, 0.0])
    np.testing.assert_allclose(
        system.transition(7, jnp.asarray(x), jnp.asarray(w)), expm(0.01 * F) @ x + w, rtol=1e-14
    )
    Q = quad_vec(lambda s: expm(F * s) @ np.diag([0, 0, 0.3, 0.3]) @ expm(F * s).T, 0, 0.01)[0]
    np.testing.assert_allclose(system.process_cov, Q, rtol=1e-10, atol=1e-18)


@pytest.mark.parametrize("position", [(0.0, 0.0), (-0.8, 0.3), (-2.0, 1.2), (3.0, -5.0)])
def test_bearings_are_those_of_both_sensors(position):
    """The direction from a sensor, rotated back by its bearing, is the x axis."""
    system = build()
    x = jnp.array([*position, 1.0, 0.0])
    for each in (system, system.truth):
        seen = np.asarray(each.observe(0, x, jnp.array([0.01, -0.02]))) - [0.01, -0.02]
        for bearing, sensor in zip(seen, SENSORS, strict=True):
            away = complex(*np.subtract(position, sensor))
            np.testing.assert_allclose(away * np.exp(-1j * bearing), abs(away), atol=1e-12)


def test_residuals_of_bearings_wrap():
    residual = np.asarray(build().residual(jnp.array([3.1, -3.0]), jnp.array([-3.1, 0.2])))
    np.testing.assert_allclose(residual, [6.2 - 2 * np.pi, 2 * np.pi - 3.2], rtol=1e-12)


def test_published_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, np.zeros(4))
    np.testing.assert_array_equal(system.initial.cov, np.diag([0.1, 0.1, 10.0, 10.0]))
    np.testing.assert_array_equal(system.measurement_cov, 0.05**2 * np.eye(2))
    np.testing.assert_allclose(np.diag(system.process_cov)[2:], 0.1 * 0.01)
    np.testing.assert_array_equal(system.truth.initial.mean, [0.0, 0.0, 1.0, 0.0])
    np.testing.assert_array_equal(system.truth.initial.cov, np.zeros((4, 4)))
    np.testing.assert_array_equal(system.truth.process_cov, [[1e-4]])
    np.testing.assert_array_equal(system.truth.measurement_cov, system.measurement_cov)
    assert (system.interval, system.truth.interval, system.norms["position"]) == (1, 1, (0, 1))
    assert [coordinate.name for coordinate in system.coordinates] == ["x", "y", "x_rate", "y_rate"]


def test_parameters_reach_the_system():
    system = build(
        bearing_deviation=0.1, position_variance=4.0, velocity_variance=3.0, turn_deviation=0.5, interval=10
    )
    np.testing.assert_array_equal(system.initial.cov, np.diag([4.0, 4.0, 3.0, 3.0]))
    np.testing.assert_allclose(system.truth.measurement_cov, 0.01 * np.eye(2))
    np.testing.assert_array_equal(system.truth.process_cov, [[0.25]])
    assert (system.interval, system.truth.interval) == (10, 10)


def test_diverged_is_a_position_error_above_five():
    diverged = build().diverged
    assert not bool(diverged(jnp.array([3.5, -3.5, 100.0, 100.0])))
    assert bool(diverged(jnp.array([3.6, -3.6, 0.0, 0.0])))


@pytest.mark.parametrize(
    "bad",
    [
        {"bearing_deviation": 0.0},
        {"process_psd": -0.1},
        {"position_variance": 0.0},
        {"velocity_variance": float("inf")},
        {"turn_deviation": -1.0},
        {"interval": 0},
        {"sensors": 3},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
