"""Claim: submarine is straight motion beside a ship that turns, seen by bearings or by ranges and bearings."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
START = np.array([10e3, 0.0, -3.0, 4.0])
BOTH = pytest.mark.parametrize("measurement", ["bearing", "range-and-bearing"])


def build(**parameters):
    return nb.systems.build("submarine", **parameters)


def moved(system, steps, start=START):
    """States (steps + 1, 4) without unknown accelerations."""
    states = [jnp.asarray(start)]
    for k in range(steps):
        states.append(system.transition_with_inputs(k, states[-1], jnp.zeros(2)))
    return np.stack(states)


def own_track(k, speed=5.0, course=60.0, leg=20):
    """Where the ship is after k steps of 30 s: legs to the left and to the right of the x axis in turn."""
    position = np.zeros(2)
    for step in range(k):
        angle = math.radians(course if (step // leg) % 2 == 0 else -course)
        position += 30.0 * speed * np.array([math.cos(angle), math.sin(angle)])
    return position


def test_chosen_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, START)
    np.testing.assert_array_equal(system.initial.cov, np.diag([4e6, 1e6, 9.0, 9.0]))
    np.testing.assert_allclose(system.process_cov, 9e-6 * np.eye(2))
    np.testing.assert_allclose(system.measurement_cov, [[math.radians(1) ** 2]])
    active = build(measurement="range-and-bearing")
    np.testing.assert_allclose(active.measurement_cov, np.diag([1e4, math.radians(1) ** 2]))
    assert (system.measurements, active.measurements) == (1, 2)
    assert system.norms == {"position": (0, 1), "velocity": (2, 3)}
    assert [each.unit for each in system.coordinates] == ["m", "m", "m/s", "m/s"]


def test_the_submarine_goes_straight_and_is_seen_from_a_ship_that_zigzags():
    states = moved(build(), 60)
    np.testing.assert_array_equal(states[:, 2:], np.tile(START[2:], (61, 1)))
    for k in (1, 20, 21, 45, 60):
        np.testing.assert_allclose(states[k, :2], START[:2] + 30 * k * START[2:] - own_track(k), rtol=1e-12)
    other = moved(build(own_speed=2.0, own_course=-30.0, leg=7), 30)
    expected = START[:2] + 900 * START[2:] - own_track(30, 2.0, -30.0, 7)
    np.testing.assert_allclose(other[30, :2], expected, rtol=1e-12)


def test_an_unknown_acceleration_is_held_over_a_step():
    system, w = build(), jnp.array([0.01, -0.02])
    added = system.transition_with_inputs(3, START, w) - system.transition_with_inputs(3, START, 0 * w)
    np.testing.assert_allclose(added, np.concatenate([450.0 * w, 30.0 * w]), rtol=1e-9)


def test_bearings_do_not_tell_the_range_before_the_ship_turns():
    """A submarine 1.3 times as far off, with 1.3 times the velocity relative to the ship, has the same bearings."""
    system = build()
    own = np.array([5.0 * math.cos(math.radians(60)), 5.0 * math.sin(math.radians(60))])
    far = np.concatenate([1.3 * START[:2], own + 1.3 * (START[2:] - own)])
    near, far = moved(system, 30), moved(system, 30, far)
    bearing = lambda x: math.atan2(x[1], x[0])  # noqa: E731
    for k in range(1, 21):
        assert bearing(far[k]) == pytest.approx(bearing(near[k]), abs=1e-13)
    assert abs(bearing(far[30]) - bearing(near[30])) > math.radians(2)


@BOTH
def test_noise_grows_with_the_power_of_sound_lost_one_way_or_both_ways(measurement):
    system = build(measurement=measurement)
    even = build(measurement=measurement, noise_range=None)
    x = np.array([-12e3, 16e3, 0.0, 0.0])  # 20 km
    exact = [20e3, math.atan2(16, -12)][-system.measurements :]
    v = jnp.array([30.0, 0.01])[-system.measurements :]
    np.testing.assert_allclose(system.observe(0, x, 0 * v), exact, rtol=1e-14)
    np.testing.assert_allclose(even.observe(0, x, v) - np.array(exact), v, rtol=1e-9)
    growth = math.sqrt(1 + 2**2) if measurement == "bearing" else math.sqrt(1 + 2**4)
    np.testing.assert_allclose(system.observe(0, x, v) - np.array(exact), growth * v, rtol=1e-9)


def test_only_bearings_are_wrapped():
    short = 6.2 - 2 * math.pi
    one = build().innovation(jnp.array([3.1]), jnp.array([-3.1]))
    two = build(measurement="range-and-bearing").innovation(jnp.array([9e3, -3.1]), jnp.array([8e3, 3.1]))
    np.testing.assert_allclose(one, [short])
    np.testing.assert_allclose(two, [1e3, -short])


@BOTH
@pytest.mark.parametrize("name", [pytest.param("ekf", marks=pytest.mark.long), "sof-gaussian", "ukf"])
def test_filters_track_it(name, measurement):
    system = build(measurement=measurement)
    states, seen = simulated(system, 20, 16, seed=1)
    means, covs = followed(name, system, seen)
    error = states - means
    assert np.isfinite(covs).all()
    assert not np.any([system.diverged(each) for each in error.reshape(-1, 4)])
    assert system.diverged(jnp.array([15e3, 15e3, 0.0, 0.0]))
    if measurement == "range-and-bearing":
        assert np.sqrt((error[:, -1, :2] ** 2).sum(-1)).max() < 500


@pytest.mark.parametrize(
    "bad",
    [
        {"measurement": "range"},
        {"bearing_deviation": 0.0},
        {"range_deviation": -1.0},
        {"noise_range": 0.0},
        {"acceleration": -1.0},
        {"own_course": 200.0},
        {"leg": 0},
        {"depth": 100.0},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
