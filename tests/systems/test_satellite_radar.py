"""Claim: satellite-radar is two-body motion, seen above the horizon of radars on a turning earth."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench.errors import ConfigError
from tests.systems.following import followed, simulated

nb.configure()
MU, RADIUS = 3.986004418e14, 7.071e6
STILL = np.zeros(3)
SITES = ((42.6, 0.0), (38.0, 10.0))


def build(**parameters):
    return nb.systems.build("satellite-radar", **parameters)


def flight(steps, start=None):
    """States (steps + 1, 6) without unknown accelerations."""
    system = build()
    start = jnp.asarray(system.initial.mean if start is None else start)

    def advance(x, k):
        x = system.transition(k, x, jnp.zeros(3))
        return x, x

    return np.concatenate(
        [start[None], jax.jit(lambda x: jax.lax.scan(advance, x, jnp.arange(steps))[1])(start)]
    )


def site(k, latitude, longitude):
    """Inertial position (3,) of a radar at step k."""
    angle = math.radians(longitude) + 7.2921159e-5 * 10 * k
    latitude = math.radians(latitude)
    across = math.cos(latitude)
    return 6.371e6 * np.array([across * math.cos(angle), across * math.sin(angle), math.sin(latitude)])


def sighted(k, position, latitude, longitude):
    """Range, azimuth from north to east and elevation, by products with the directions up, north and east."""
    place = site(k, latitude, longitude)
    line = position - place
    away = np.linalg.norm(line)
    up = place / np.linalg.norm(place)
    east = np.cross([0.0, 0.0, 1.0], up)
    east /= np.linalg.norm(east)
    north = np.cross(up, east)
    return [away, math.atan2(line @ east, line @ north), math.asin(line @ up / away)]


def test_chosen_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.cov, np.diag([4e8] * 3 + [400.0] * 3))
    np.testing.assert_allclose(system.process_cov, 1e-4 * np.eye(3))
    angle = math.radians(0.05) ** 2
    np.testing.assert_allclose(system.measurement_cov, np.diag([400.0, angle, angle]))
    np.testing.assert_allclose(build(radars=2).measurement_cov, np.diag([400.0, angle, angle] * 2))
    assert system.norms == {"position": (0, 1, 2), "velocity": (3, 4, 5)}
    assert [each.unit for each in system.coordinates] == ["m"] * 3 + ["m/s"] * 3


def test_the_orbit_is_circular_700_km_high_and_inclined_by_98_degrees():
    p, v = np.split(np.asarray(build().initial.mean), 2)
    momentum = np.cross(p, v)
    assert np.linalg.norm(p) == pytest.approx(RADIUS, rel=1e-12)
    assert v @ v == pytest.approx(MU / RADIUS, rel=1e-12)
    assert abs(p @ v) < 1e-3
    assert math.degrees(math.acos(momentum[2] / np.linalg.norm(momentum))) == pytest.approx(98.0)
    assert v[2] > 0


def test_energy_and_angular_momentum_are_conserved():
    """Over an orbit, to less than what one Runge-Kutta step of h = .0106 rad may err, h^5 = 1.3e-10."""
    states = flight(594)
    p, v = states[:, :3], states[:, 3:]
    energy = (v**2).sum(1) / 2 - MU / np.sqrt((p**2).sum(1))
    assert np.abs(energy / energy[0] - 1).max() < 1.3e-10
    momentum = np.cross(p, v)
    assert np.abs(momentum - momentum[0]).max() / np.linalg.norm(momentum[0]) < 1.3e-10


def test_a_step_is_ten_seconds_of_the_motion():
    """Also on an ellipse, against DOP853: within a tenth of a millimetre."""
    for factor in (1.0, 1.1, 0.9):
        start = np.asarray(build().initial.mean) * np.array([1, 1, 1, factor, factor, factor])
        rate = lambda t, x: [*x[3:], *(-MU * x[:3] / (x[:3] @ x[:3]) ** 1.5)]  # noqa: E731
        end = solve_ivp(rate, (0, 10), start, method="DOP853", rtol=1e-13, atol=1e-6).y[:, -1]
        assert np.abs(flight(1, start)[1] - end)[:3].max() < 1e-4


def test_an_unknown_acceleration_is_held_over_a_step():
    system, w = build(), np.array([0.3, -0.2, 0.1])
    x = np.asarray(system.initial.mean)
    added = system.transition(0, x, w) - system.transition(0, x, STILL)
    np.testing.assert_allclose(added, np.concatenate([50.0 * w, 10.0 * w]), rtol=1e-6)


def test_the_satellite_is_above_the_horizon_of_both_radars_for_eight_minutes():
    system, states = build(radars=2), flight(48)
    elevations = []
    for k in range(49):
        seen = system.observe(k, states[k], jnp.zeros(6))
        expected = [each for place in SITES for each in sighted(k, states[k, :3], *place)]
        np.testing.assert_allclose(seen, expected, rtol=1e-9)
        elevations.append([seen[2], seen[5]])
    elevations = np.degrees(elevations)
    assert elevations.min() > 7
    assert elevations[:, 0].max() == pytest.approx(50, abs=1)


def test_the_first_pass_is_from_south_to_north_in_the_east():
    system = build()
    azimuths = np.degrees([system.observe(k, x, STILL)[1] for k, x in enumerate(flight(48))])
    assert (np.diff(azimuths) < 0).all()
    assert 90 < azimuths[0] < 180
    assert 0 < azimuths[-1] < 90


def test_azimuths_are_wrapped():
    y, h = jnp.array([5.0, 3.1, 0.5] * 2), jnp.array([1.0, -3.1, 0.1] * 2)
    np.testing.assert_allclose(build(radars=2).innovation(y, h), [4.0, 6.2 - 2 * math.pi, 0.4] * 2)


@pytest.mark.parametrize("radars", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("ekf", marks=pytest.mark.long),
        pytest.param("sof-gaussian", marks=pytest.mark.long),
        "ukf",
    ],
)
def test_filters_track_it(name, radars):
    system = build(radars=radars)
    states, seen = simulated(system, 20, 16, seed=1)
    means, covs = followed(name, system, seen)
    error = np.sqrt(((states - means)[..., :3] ** 2).sum(-1))
    assert np.isfinite(covs).all()
    assert error.max() < 20e3
    assert not system.diverged(jnp.array([1e5, 1e5, 1e5, 0.0, 0.0, 0.0]))
    assert system.diverged(jnp.array([2e5, 1e3, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    "bad",
    [
        {"radars": 3},
        {"range_deviation": 0.0},
        {"angle_deviation": -0.1},
        {"acceleration": -1.0},
        {"position_deviation": 0.0},
        {"interval": 0},
        {"height": 500.0},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))) as caught:
        build(**bad)
    assert len(caught.value.problems) == 1
