"""Claim: two-body motion, the landmark's angle and the local vertical are those of section 8.3, in both coordinates."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nlbench import orbit
from tests.oracle import rng
from tests.problems import assert_golden, golden, golden_ids

MU, R0 = 1.3, 1.7
STATES = [np.array([1.6, 0.5, -0.3, 0.8]), np.array([-1.1, -1.3, 0.7, -0.4]), np.array([0.2, -1.9, 0.8, 0.1])]
EVERY_STATE = pytest.mark.parametrize("x", STATES)


def cases(group):
    return pytest.mark.parametrize("case", list(golden(group)), ids=golden_ids(group))


@cases("culver.landmark")
def test_landmark_angle_and_its_derivatives_are_the_golden_ones(case):
    _, given, expected = case
    found = orbit.expand_landmark_angle(given["x"], given["theta1"], given["R1"])
    assert_golden(found.value, expected["phi"], "phi")
    assert_golden(found.first, expected["H"], "H")
    assert_golden(found.second[:2, :2], expected["M_sym_2x2"], "M")
    np.testing.assert_array_equal(found.second[2:], 0.0)


@cases("culver.orbit_expansion")
def test_drift_and_its_derivatives_are_the_golden_ones(case):
    _, given, expected = case
    found = orbit.expand_cartesian_drift(given["x"], given["mu"])
    assert_golden(found.value, expected["f"], "f")
    assert_golden(found.first[2:, :2], expected["F_lower_left"], "F")
    np.testing.assert_array_equal(found.first[:2], [[0, 0, 1, 0], [0, 0, 0, 1]])
    assert_golden(found.second[2, :2, :2], expected["A_sym_3"], "A_3")
    assert_golden(found.second[3, :2, :2], expected["A_sym_4"], "A_4")


@cases("culver.local_vertical")
def test_local_vertical_error_is_the_golden_one(case):
    _, given, expected = case
    names = ("altitude", "range", "altitude_velocity", "range_velocity")
    found = orbit.local_vertical_error(given["err"], given["x_true"])
    for value, name in zip(found, names, strict=True):
        assert_golden(value, expected[name], name)


@EVERY_STATE
def test_landmark_angle_is_the_form_of_the_source_on_the_visible_side(x):
    """(8.28): phi = pi + theta - asin(R sin(theta_l - theta)/distance)."""
    theta, r, radius = np.arctan2(x[1], x[0]), np.hypot(x[0], x[1]), 0.9
    for offset in (-0.3, 0.0, 0.25):
        distance = np.sqrt(radius**2 + r**2 - 2 * radius * r * np.cos(offset))
        printed = np.pi + theta - np.arcsin(radius * np.sin(offset) / distance)
        found = orbit.landmark_angle(x, theta + offset, radius)
        assert abs(np.exp(1j * float(found)) - np.exp(1j * printed)) < 1e-12


@EVERY_STATE
def test_polar_and_cartesian_states_are_each_other_s_inverse(x):
    np.testing.assert_allclose(orbit.cartesian(orbit.polar(x, R0), R0), x, rtol=1e-13)


@EVERY_STATE
def test_the_two_drifts_are_one_motion(x):
    """The polar drift is the Cartesian one carried over by the Jacobian of the coordinates."""
    p, moved = jax.jvp(lambda x: orbit.polar(x, R0), (jnp.asarray(x),), (orbit.cartesian_drift(x, MU),))
    np.testing.assert_allclose(orbit.polar_drift(p, MU, R0), moved, rtol=1e-12, atol=1e-13)


@EVERY_STATE
def test_motion_keeps_energy_and_angular_momentum(x):
    path = solve_ivp(lambda t, x: orbit.cartesian_drift(x, MU), (0, 3), x, rtol=1e-11, atol=1e-12).y
    energy = 0.5 * (path[2] ** 2 + path[3] ** 2) - MU / np.hypot(path[0], path[1])
    momentum = path[0] * path[3] - path[1] * path[2]
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-8)


def test_wrapped_angles_are_the_nearest_equal_ones():
    angles = rng(3).uniform(-30, 30, 200)
    found = np.asarray(orbit.wrapped(angles))
    assert (np.abs(found) <= np.pi).all()
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * angles), atol=1e-12)
