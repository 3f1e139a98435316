"""Claim: aircraft-radar is quadratic drag in an exponential atmosphere, seen by a radar with noise that grows."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
START = np.array([-150e3, 20e3, 10e3, 240.0, 0.0, -5.0])
STILL = jnp.zeros(3)


def build(**parameters):
    return nb.systems.build("aircraft-radar", **parameters)


def flown(start, thrust, span, drag_area=5e-5):
    """The equations of motion, integrated to rounding."""

    def rate(t, x):
        speed = math.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
        drag = drag_area / 2 * 1.225 * math.exp(-x[2] / 8500) * speed**2
        return [*x[3:], *((thrust - drag) * x[3:] / speed)]

    return solve_ivp(rate, (0, span), start, method="DOP853", rtol=1e-13, atol=1e-9).y[:, -1]


def moved(system, steps, start=START):
    x = jnp.asarray(start)
    for k in range(*steps):
        x = system.transition_with_inputs(k, x, STILL)
    return np.asarray(x)


def speed(x):
    return np.linalg.norm(x[3:])


def test_chosen_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, START)
    np.testing.assert_allclose(system.initial.cov, np.diag([4e6, 4e6, 1e6, 900.0, 900.0, 25.0]), rtol=1e-15)
    np.testing.assert_allclose(system.process_cov, np.diag([0.25, 0.25, 0.01]))
    np.testing.assert_allclose(system.measurement_cov, np.diag([1e4, *[math.radians(1) ** 2] * 2]))
    assert (system.interval, system.clip) == (1, (10e3,) * 3 + (100.0,) * 3)
    assert system.norms == {"position": (0, 1, 2), "velocity": (3, 4, 5)}
    assert [each.unit for each in system.coordinates] == ["m"] * 3 + ["m/s"] * 3


@pytest.mark.parametrize("thrust", [0.0, 0.544])
@pytest.mark.parametrize("start", [START, [1e3, 2e3, 300.0, -120.0, 90.0, 20.0]])
def test_a_step_is_ten_seconds_of_the_motion(start, thrust):
    """To a millimetre and a hundredth of a millimetre per second, also where the air is dense."""
    system = build(thrust=thrust, thrust_steps=1)
    wrong = moved(system, (0, 1), start) - flown(start, thrust, 10.0)
    assert np.abs(wrong[:3]).max() < 1e-3
    assert np.abs(wrong[3:]).max() < 1e-5


def test_the_engines_hold_the_speed_and_without_them_drag_takes_it():
    """Thrust balances drag at the start; later the air is denser, and after step 40 there is no thrust."""
    system = build()
    first, last_powered, last = (moved(system, (0, k)) for k in (1, 40, 60))
    assert speed(first) == pytest.approx(speed(START), abs=0.05)
    assert speed(START) - 40 < speed(last_powered) < speed(START)
    assert speed(last) < speed(last_powered) - 50
    no_drag = moved(build(drag_area=0.0, thrust=0.0), (0, 60))
    np.testing.assert_allclose(no_drag, [*(START[:3] + 600 * START[3:]), *START[3:]], rtol=1e-12)


def test_drag_grows_with_the_square_of_speed_and_falls_by_e_in_8500_metres():
    """To first order in a short flight's loss: the ratios of the losses, corrected for nothing."""
    system = build(thrust=0.0, drag_area=1e-9)

    def loss(height, v):
        return v - speed(moved(system, (0, 1), [0.0, 0.0, height, v, 0.0, 0.0]))

    assert loss(0.0, 200.0) / loss(0.0, 100.0) == pytest.approx(4.0, rel=1e-3)
    assert loss(0.0, 200.0) / loss(8500.0, 200.0) == pytest.approx(math.e, rel=1e-3)


def test_unknown_accelerations_are_held_over_a_step():
    system, w = build(), jnp.array([0.3, -0.2, 0.1])
    added = system.transition_with_inputs(0, START, w) - system.transition_with_inputs(0, START, STILL)
    np.testing.assert_allclose(added, np.concatenate([50.0 * w, 10.0 * w]), rtol=1e-9)


def test_the_radar_sees_range_and_angles_with_noise_that_doubles_its_variance_at_100_km():
    system, v = build(), jnp.array([100.0, 0.01, -0.02])
    x = np.concatenate([1e5 * np.array([0.6, -0.48, 0.64]), np.zeros(3)])
    exact = [1e5, math.atan2(-0.48, 0.6), math.asin(0.64)]
    np.testing.assert_allclose(system.observe(0, x, jnp.zeros(3)), exact, rtol=1e-13)
    noise = system.observe(0, x, v) - np.array(exact)
    np.testing.assert_allclose(noise, math.sqrt(2) * v, rtol=1e-8)
    twice = system.observe(0, 2 * x, v) - system.observe(0, 2 * x, jnp.zeros(3))
    np.testing.assert_allclose(twice, math.sqrt(17) * v, rtol=1e-8)
    even = build(noise_range=None)
    np.testing.assert_allclose(even.observe(0, x, v) - np.array(exact), v, rtol=1e-8)


def test_the_azimuth_behind_the_radar_is_wrapped():
    np.testing.assert_allclose(
        build().innovation(jnp.array([5.0, 3.1, 0.0]), jnp.array([1.0, -3.1, 0.0])),
        [4.0, 6.2 - 2 * math.pi, 0.0],
    )


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("ekf", marks=pytest.mark.long),
        pytest.param("sof-gaussian", marks=pytest.mark.long),
        "ukf",
    ],
)
def test_filters_track_it(name):
    """Some kilometres at this range and these angles, never lost in 20 scans."""
    system = build()
    states, seen = simulated(system, 20, 16, seed=1)
    means, covs = followed(name, system, seen)
    assert np.isfinite(covs).all()
    assert np.sqrt(((states - means)[..., :3] ** 2).sum(-1)).max() < 15e3
    assert system.diverged((states - means)[0, 0]) == np.False_
    assert system.diverged(jnp.array([90e3, 90e3, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    "bad",
    [
        {"range_deviation": 0.0},
        {"angle_deviation": -1.0},
        {"noise_range": 0.0},
        {"drag_area": -1e-5},
        {"thrust_steps": 2.5},
        {"interval": 0},
        {"wind": 10.0},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
