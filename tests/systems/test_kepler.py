"""Claim: the closed form is two-body motion, for circles and ellipses, many revolutions, with its derivatives."""

from __future__ import annotations

import math

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nlbench.systems import kepler

MU = 1.66935e14  # ft^3/s^2
LUNAR = {"100-mile": (6.228e6, 5175.0, 50.0, 40_000.0), "500-mile": (8.34e6, 4470.0, 30.0, 300_000.0)}


def on_ellipse(e, true_anomaly, turned=0.7, axis=1.0):
    """A state (4,) on an ellipse of eccentricity e, for mu = 1."""
    p = axis * (1 - e * e)
    r = p / (1 + e * math.cos(true_anomaly))
    position = r * np.array([math.cos(true_anomaly), math.sin(true_anomaly)])
    velocity = np.array([-math.sin(true_anomaly), e + math.cos(true_anomaly)]) / math.sqrt(p)
    c, s = math.cos(turned), math.sin(turned)
    turn = np.array([[c, -s], [s, c]])
    return np.concatenate([turn @ position, turn @ velocity])


def attraction(t, x, mu=1.0):
    g = -mu / np.hypot(x[0], x[1]) ** 3
    return np.array([x[2], x[3], g * x[0], g * x[1]])


def variation(t, flat):
    """The state and its derivative by the initial state, (4 + 16,)."""
    x, Phi = flat[:4], flat[4:].reshape(4, 4)
    r = np.hypot(x[0], x[1])
    pull = 3 * np.outer(x[:2], x[:2]) / r**5 - np.eye(2) / r**3
    F = np.block([[np.zeros((2, 2)), np.eye(2)], [pull, np.zeros((2, 2))]])
    return np.concatenate([attraction(t, x), (F @ Phi).ravel()])


def integrated(right_hand_side, times, start):
    return solve_ivp(
        right_hand_side, (0, times[-1]), start, "DOP853", t_eval=times, rtol=3e-14, atol=1e-14
    ).y.T


def at_times(function):
    return jax.jit(jax.vmap(function, in_axes=(0, None, None)))


flows, slopes = at_times(kepler.flow), at_times(jax.jacfwd(kepler.flow, argnums=1))


def flow(times, start, mu=1.0):
    return np.asarray(flows(np.asarray(times), start, mu))


def slope(times, start):
    return np.asarray(slopes(np.asarray(times), start, 1.0))


@pytest.mark.parametrize("true_anomaly", [0.0, 1.3, math.pi, -2.0])
@pytest.mark.parametrize("e", [0.0, 0.01, 0.05, 0.5, 0.9])
def test_equals_numerical_integration_over_a_revolution(e, true_anomaly):
    start, times = on_ellipse(e, true_anomaly), np.linspace(0.01, 2 * math.pi, 40)
    expected = integrated(attraction, times, start)
    np.testing.assert_allclose(flow(times, start), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("case", LUNAR)
def test_equals_numerical_integration_of_the_lunar_orbits(case):
    r0, v0, _, end = LUNAR[case]
    start, unit = np.array([r0, 800.0, -2.0, v0]), np.array([r0, r0, v0, v0])
    times = np.linspace(end / 20, end, 20)
    scaled = flow(times, start, MU) / unit
    second = math.sqrt(r0**3 / MU)  # integrated in units of r0 and this time
    scale = np.array([r0, r0, r0 / second, r0 / second])
    expected = integrated(attraction, times / second, start / scale) * scale / unit
    np.testing.assert_allclose(scaled, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("e", [0.0, 0.05, 0.9])
def test_fifty_revolutions_return_to_the_start(e):
    """To what a rounding of the start makes of it."""
    start = on_ellipse(e, 0.4)
    times = 2 * math.pi * np.array([-50.0, -1.0, 0.0, 1.0, 50.0])
    rounded = np.finfo(float).eps * (np.abs(slope(times, start)) @ np.abs(start))
    assert (np.abs(flow(times, start) - start) <= 2 * rounded).all()


@pytest.mark.parametrize("e", [0.0, 0.05, 0.9])
def test_energy_and_angular_momentum_stay(e):
    start = on_ellipse(e, -1.1)
    x, y, u, v = flow(np.linspace(0, 300, 3001), start).T
    np.testing.assert_allclose((u * u + v * v) / 2 - 1 / np.hypot(x, y), -0.5, atol=1e-12 / (1 - e))
    np.testing.assert_allclose(x * v - y * u, math.sqrt(1 - e * e), atol=1e-12)


@pytest.mark.parametrize("e", [0.0, 0.05, 0.6])
def test_the_derivative_solves_the_variational_equation(e):
    start, times = on_ellipse(e, 0.9), np.linspace(1, 20, 7)
    expected = integrated(variation, times, np.concatenate([start, np.eye(4).ravel()]))[:, 4:].reshape(
        -1, 4, 4
    )
    np.testing.assert_allclose(slope(times, start), expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_second_derivative_is_the_slope_of_the_first():
    start, h = on_ellipse(0.05, 0.9), 1e-5
    second = jax.jit(jax.jacfwd(jax.jacfwd(lambda x: kepler.flow(4.0, x, 1.0))))(start)
    differences = [(slope([4.0], start + d) - slope([4.0], start - d))[0] / (2 * h) for d in h * np.eye(4)]
    np.testing.assert_allclose(second, np.stack(differences, axis=-1), atol=1e-7 * np.abs(second).max())


@pytest.mark.parametrize("case", LUNAR)
def test_rk4_converges_to_it(case):
    """Its error is a h^4 t + b h^5 t^2 (the energy drifts). With the step of the experiment it is 32 ft (100-mile) and
    7 ft (500-mile) away at the end."""
    r0, v0, step, end = LUNAR[case]
    start = np.array([r0, 0.0, 0.0, v0])
    exact = flow([end], start, MU)[0]
    misses = []
    for h in (step, step / 2):
        x = start
        for _ in range(round(end / h)):
            a = attraction(0, x, MU)
            b = attraction(0, x + h / 2 * a, MU)
            c = attraction(0, x + h / 2 * b, MU)
            x = x + h / 6 * (a + 2 * b + 2 * c + attraction(0, x + h * c, MU))
        misses.append(np.hypot(*(x - exact)[:2]))
    assert 2**4 < misses[0] / misses[1] < 2**5
    assert misses[0] == pytest.approx({"100-mile": 31.6, "500-mile": 7.0}[case], rel=0.02)


def test_a_hyperbola_is_not_a_number():
    assert np.isnan(flow([1.0], np.array([1.0, 0.0, 0.0, 1.5]))).all()
