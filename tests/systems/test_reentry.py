"""Claim: re-entry moves by gravity and by drag as printed, in Euler steps, and filters do not know the drag."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError

NONE = np.zeros(3)
START = np.array([6500.4, 349.14, -1.8093, -6.7967, 0.6932])


def build(**parameters):
    return nb.systems.build("re-entry", **parameters)


def rate(x):
    """The printed differential equations."""
    R, V = np.hypot(x[0], x[1]), np.hypot(x[2], x[3])
    D = -0.59783 * np.exp(x[4]) * np.exp((6374 - R) / 13.406) * V
    G = -3.9860e5 / R**3
    return np.array([x[2], x[3], D * x[2] + G * x[0], D * x[3] + G * x[1], 0.0])


@pytest.mark.parametrize("x", [START, [6390.0, 50.0, -0.5, -3.0, 0.1], [6400.0, 0.0, -1.0, 0.5, -1.0]])
def test_a_step_is_eulers_and_its_noise_moves_velocity_and_drag(x):
    """In this order: position by the velocity at the step's start; noise not times the step."""
    system, w = build(), np.array([1e-3, -2e-3, 5e-3])
    x = np.asarray(x, float)
    expected = x + 0.1 * rate(x) + np.array([0, 0, *w])
    for each in (system, system.truth):
        np.testing.assert_allclose(each.transition(3, jnp.asarray(x), jnp.asarray(w)), expected, rtol=1e-13)


def test_drag_only_slows_down_and_without_it_gravity_keeps_energy_and_angular_momentum():
    """Rates of change of both, from one step: zero above the air, negative in it."""
    system = build()

    def changes(x):
        v = (np.asarray(system.transition(0, jnp.asarray(x), NONE)) - x) / 0.1
        energy = (
            x[2] * v[2] + x[3] * v[3] + 3.9860e5 * (x[0] * v[0] + x[1] * v[1]) / np.hypot(x[0], x[1]) ** 3
        )
        return energy, v[0] * x[3] + x[0] * v[3] - v[1] * x[2] - x[1] * v[2]

    np.testing.assert_allclose(changes(np.array([6500.4, 349.14, -1.8, -6.8, -60.0])), 0.0, atol=1e-9)
    low = np.array([6390.0, 50.0, -0.5, -3.0, 0.7])
    assert changes(low)[0] < -1.0
    assert changes(low)[1] > 0  # the motion is clockwise: its angular momentum is negative, and shrinks


def test_the_radar_sees_range_and_angle_from_the_ground():
    """The position, rebuilt from both."""
    system, x = build(), START
    seen = np.asarray(system.observe(0, jnp.asarray(x), jnp.array([2e-3, 1e-4]))) - [2e-3, 1e-4]
    np.testing.assert_allclose(
        [6374 + seen[0] * np.cos(seen[1]), seen[0] * np.sin(seen[1])], x[:2], rtol=1e-12
    )


def test_the_residual_of_the_angle_wraps_and_that_of_the_range_does_not():
    residual = np.asarray(build().residual(jnp.array([900.0, 3.0]), jnp.array([100.0, -3.0])))
    np.testing.assert_allclose(residual, [800.0, 6.0 - 2 * np.pi], rtol=1e-12)


def test_published_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, [*START[:4], 0.0])
    np.testing.assert_array_equal(system.initial.cov, np.diag([1e-6, 1e-6, 1e-6, 1e-6, 1.0]))
    np.testing.assert_array_equal(system.process_cov, np.diag([2.4064e-5, 2.4064e-5, 1e-6]))
    np.testing.assert_allclose(system.measurement_cov, np.diag([1e-6, 2.89e-8]), rtol=1e-12)
    np.testing.assert_array_equal(system.truth.initial.mean, START)
    np.testing.assert_array_equal(system.truth.initial.cov, np.diag([1e-6, 1e-6, 1e-6, 1e-6, 0.0]))
    np.testing.assert_array_equal(system.truth.process_cov, np.diag([2.4064e-5, 2.4064e-5, 0.0]))
    np.testing.assert_array_equal(system.truth.measurement_cov, system.measurement_cov)
    assert (system.interval, system.norms["position"], system.norms["velocity"]) == (1, (0, 1), (2, 3))
    assert [(each.name, each.unit) for each in system.coordinates] == [
        ("x", "km"), ("y", "km"), ("x_rate", "km/s"), ("y_rate", "km/s"), ("drag", ""),
    ]  # fmt: skip


def test_the_vehicle_comes_down_in_200_seconds_but_not_into_the_ground():
    """Undisturbed, as in the source's figure: from 136 km height it slows from 7 km/s to well below 1 km/s."""
    system = build().truth

    def advance(x, k):
        x = system.transition(k, x, NONE)
        return x, x

    x = np.asarray(jax.lax.scan(advance, jnp.asarray(START), jnp.arange(2000))[1])
    height, speed = np.hypot(x[:, 0], x[:, 1]) - 6374, np.hypot(x[:, 2], x[:, 3])
    assert 130 < height[0] < 140
    assert speed[0] > 7
    assert height[-1] > 0
    assert speed[-1] < 0.5
    np.testing.assert_array_equal(x[:, 4], START[4])


def test_diverged_is_a_position_error_above_a_hundred_kilometers():
    diverged = build().diverged
    assert not bool(diverged(jnp.array([70.0, -70.0, 1e3, 1e3, 1e3])))
    assert bool(diverged(jnp.array([71.0, -71.0, 0.0, 0.0, 0.0])))


@pytest.mark.parametrize(
    "bad",
    [
        {"range_deviation": 0.0},
        {"angle_deviation": -1.0},
        {"process_variance": -1e-9},
        {"drag_process_variance": float("nan")},
        {"drag_variance": 0.0},
        {"interval": 0},
        {"step": 0.1},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
