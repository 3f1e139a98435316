"""Claim: importance sampling around the most probable initial state is Bayes's rule, and says how normal it is."""

from __future__ import annotations

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from nlbench.moments.moments import Moments
from nlbench.references.initial_posterior import posterior_track

KEY = jax.random.key(4)
NEVER = math.inf


def difference(y, h):
    return y - h


# A linear system of three states, two measurements at a time with correlated noise and another matrix each time.
A = np.array([[0.0, 1.0, 0.0], [-1.0, -0.2, 0.5], [0.3, 0.0, -0.1]])
H = np.random.default_rng(1).normal(size=(4, 2, 3))
R = np.array([[0.5, 0.2], [0.2, 0.4]])
START = Moments(np.array([1.0, -2.0, 0.5]), np.array([[2.0, 0.6, 0.1], [0.6, 1.0, -0.3], [0.1, -0.3, 0.8]]))
TIMES = np.array([0.5, 0.9, 2.0, NEVER])
OUTPUTS = np.array([0.0, 0.4, 0.5, 1.7, 2.0, 3.0])
VALUES, VECTORS = np.linalg.eig(A)
Y = np.array([[1.0, 0.3], [-0.4, 2.0], [0.2, 0.1], [np.nan, np.nan]])


def linear_track(times, y, matrices=H):
    return posterior_track(
        flow=lambda t, x: jnp.real((VECTORS * jnp.exp(VALUES * t)) @ (np.linalg.inv(VECTORS) @ x)),
        observe=lambda number, x: jnp.asarray(matrices)[number] @ x,
        residual=difference,
        prior=START,
        noise_cov=R,
        output_times=OUTPUTS,
        times=times,
        measurements=y,
        key=KEY,
    )


batch = jax.jit(jax.vmap(linear_track))


def linear(times, y, matrices=H, companion=NEVER):
    """One trajectory, in a batch with another, all of whose measurements are at the time `companion`."""
    times, y, matrices = (
        np.stack(pair) for pair in ((times, np.full(4, companion)), (y, Y[::-1]), (matrices, -H))
    )
    return jax.tree.map(lambda leaf: leaf[0], batch(times, y, matrices))


def kalman(times, y, t):
    """Mean and covariance at t by the Kalman filter, without process noise."""
    m, P, now = START.mean, START.cov, 0.0
    for number, (when, value) in enumerate(zip(times, y, strict=True)):
        if when > t:
            break
        Phi, h = expm(A * (when - now)), H[number]
        m, P, now = Phi @ m, Phi @ P @ Phi.T, when
        K = np.linalg.solve(h @ P @ h.T + R, h @ P).T
        m, P = m + K @ (value - h @ m), P - K @ h @ P
    Phi = expm(A * (t - now))
    return Phi @ m, Phi @ P @ Phi.T


def test_equals_the_kalman_filter_where_flow_and_measurement_are_linear():
    """An output at the time of a measurement comes after it."""
    track = linear(TIMES, Y)
    for place, t in enumerate(OUTPUTS):
        mean, cov = kalman(TIMES[:3], Y[:3], t)
        np.testing.assert_allclose(track.mean[place], mean, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(track.cov[place], cov, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(track.third, 0, atol=1e-10)
    np.testing.assert_allclose(track.effective, 1, rtol=1e-10)


def test_a_missing_measurement_changes_nothing():
    """Though it has a number: the measurement after it has the next one."""
    expected = linear(np.array([0.5, 0.9, NEVER, np.nan]), np.array([Y[0], Y[1], [7.0, 7.0], [7.0, 7.0]]))
    gap = np.array([Y[0], [9.0, np.nan], Y[1], [7.0, 7.0]])
    track = linear(np.array([0.5, 0.7, 0.9, NEVER]), gap, H[[0, 3, 1, 2]])
    for mine, theirs in zip(track, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_trajectory_does_not_depend_on_its_companions_in_a_batch(count):
    times = np.where(np.arange(4) < count, TIMES, NEVER)
    for mine, theirs in zip(linear(times, Y), linear(times, Y, companion=0.2), strict=True):
        np.testing.assert_array_equal(mine, theirs)


# A scalar system, dx/dt = -x^3, seen through an arctangent.
SCALAR_TIMES, SCALAR_Y, SCALAR_R = np.array([0.2, 0.7]), np.array([[0.9], [0.35]]), 0.02
SCALAR_OUTPUTS = np.array([0.1, 0.4, 1.5])


def decaying(t, x):
    return x / np.sqrt(1 + 2 * t * x * x)


def surprise(x0, count):
    """Minus the logarithm of the prior times the likelihood of the first measurements, up to a constant."""
    taken = zip(SCALAR_TIMES[:count], SCALAR_Y[:count, 0], strict=True)
    misfit = sum((y - np.arctan(decaying(t, x0))) ** 2 / SCALAR_R for t, y in taken)
    return 0.5 * ((x0 - 1.0) ** 2 / 0.5 + misfit)


@pytest.fixture(scope="module")
def scalar_track():
    """With 40 radii: in one dimension, Gauss-Hermite quadrature with 80 nodes."""
    return jax.jit(
        lambda y: posterior_track(
            flow=lambda t, x: x / jnp.sqrt(1 + 2 * t * x * x),
            observe=lambda number, x: jnp.arctan(x),
            residual=difference,
            prior=Moments(np.array([1.0]), np.array([[0.5]])),
            noise_cov=np.array([[SCALAR_R]]),
            output_times=SCALAR_OUTPUTS,
            times=SCALAR_TIMES,
            measurements=y,
            key=KEY,
            radii=40,
            turns=1,
        )
    )(SCALAR_Y)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_equals_adaptive_quadrature_over_a_scalar_initial_state(scalar_track, count):
    t = SCALAR_OUTPUTS[count]

    def expectation(function):
        return quad(lambda x0: function(x0) * np.exp(-surprise(x0, count)), -6, 8, epsabs=1e-13, limit=400)[0]

    total = expectation(lambda x0: 1.0)
    mean = expectation(lambda x0: decaying(t, x0)) / total
    variance, third = (expectation(lambda x0, k=k: (decaying(t, x0) - mean) ** k) / total for k in (2, 3))
    scale = math.sqrt(variance)
    np.testing.assert_allclose(scalar_track.mean[count], [mean], rtol=0, atol=1e-5 * scale)
    np.testing.assert_allclose(scalar_track.cov[count], [[variance]], rtol=1e-5)
    np.testing.assert_allclose(scalar_track.third[count], [[[third]]], rtol=0, atol=1e-5 * scale**3)


def test_the_effective_share_compares_the_density_with_the_normal_one_around_its_mode(scalar_track):
    """Integral q^2 / integral p^2 as the spacing of the nodes vanishes; it varies by some percent of itself."""
    mode = minimize_scalar(lambda x0: surprise(x0, 2), bounds=(0, 3), method="bounded").x
    h = 1e-4
    slopes = [
        (np.arctan(decaying(t, mode + h)) - np.arctan(decaying(t, mode - h))) / (2 * h) for t in SCALAR_TIMES
    ]
    information = 1 / 0.5 + sum(slope**2 / SCALAR_R for slope in slopes)
    total, squared = (quad(lambda x, k=k: np.exp(-k * surprise(x, 2)), -6, 8, limit=400)[0] for k in (1, 2))
    share = math.sqrt(information / (4 * math.pi)) * total**2 / squared
    np.testing.assert_allclose(scalar_track.effective[2], share, rtol=0.05)
    np.testing.assert_allclose(scalar_track.effective[0], 1, rtol=1e-12)


# A quadratic motion in the plane, and a bearing.
PLANE = Moments(np.array([1.0, 0.4]), np.array([[0.2, 0.05], [0.05, 0.1]]))
BEARING, BEARING_R = 0.9, 0.04
ROTATIONS = jax.random.split(KEY, 64)


def bent(t, x):
    return jnp.stack([x[0] + t * x[1] ** 2, x[1] - t * x[0]])


@jax.jit
@partial(jax.vmap, in_axes=(None, 0))
def plane_tracks(time, key):
    return posterior_track(
        flow=bent,
        observe=lambda number, x: jnp.arctan2(x[1], x[0])[None],
        residual=difference,
        prior=PLANE,
        noise_cov=np.array([[BEARING_R]]),
        output_times=np.array([0.5, 1.0]),
        times=time,
        measurements=np.array([[BEARING]]),
        key=key,
        radii=10,
        turns=16,
    )


def test_without_measurements_the_prior_is_carried_along_the_flow():
    """Mean and covariance of a quadratic flow are polynomials of the fourth degree: exact."""
    track = plane_tracks(np.array([NEVER]), ROTATIONS)
    (m1, m2), (a, c, b) = PLANE.mean, PLANE.cov[np.triu_indices(2)]
    for place, t in enumerate((0.5, 1.0)):
        mean = [m1 + t * (m2**2 + b), m2 - t * m1]
        var_square, cov_square = 2 * b**2 + 4 * m2**2 * b, 2 * m2 * np.array([c, b])  # of x2^2; with x1, x2
        first = a + 2 * t * cov_square[0] + t**2 * var_square
        cross = c - t * a + t * (cov_square[1] - t * cov_square[0])
        cov = [[first, cross], [cross, b - 2 * t * c + t**2 * a]]
        np.testing.assert_allclose(track.mean[:, place], np.tile(mean, (64, 1)), rtol=1e-12)
        np.testing.assert_allclose(track.cov[:, place], np.tile(cov, (64, 1, 1)), rtol=1e-11)


def test_equals_a_grid_over_a_plane_of_initial_states_in_the_mean_over_rotations():
    """|z| < 4 over 64 rotations, whose mean is known to better than a hundredth of the spread."""
    track = plane_tracks(np.array([0.0]), ROTATIONS)
    root = np.linalg.cholesky(PLANE.cov)
    side = np.linspace(-7, 7, 1401)
    z = np.stack(np.meshgrid(side, side)).reshape(2, -1)
    x0 = PLANE.mean[:, None] + root @ z
    weights = np.exp(-0.5 * (z**2).sum(axis=0) - 0.5 * (BEARING - np.arctan2(x0[1], x0[0])) ** 2 / BEARING_R)
    weights /= weights.sum()
    for place, t in enumerate((0.5, 1.0)):
        x = np.stack([x0[0] + t * x0[1] ** 2, x0[1] - t * x0[0]])
        mean = x @ weights
        d = x - mean[:, None]
        scale = np.sqrt(weights @ (d**2).T)
        expected = (mean, (weights * d) @ d.T, np.einsum("p,ip,jp,kp->ijk", weights, d, d, d, optimize=True))
        for mine, theirs in zip(track[:3], expected, strict=True):
            unit = np.multiply.reduce(np.meshgrid(*[scale] * theirs.ndim, indexing="ij"))
            off = (np.asarray(mine[:, place]) - theirs) / unit
            error = off.std(axis=0) / 8
            assert np.abs(off.mean(axis=0) / error).max() < 4
            assert error.max() < 0.01


def test_a_flow_that_fails_is_not_a_number():
    def track(t):
        return posterior_track(
            flow=lambda t, x: jnp.where(t > 1.5, jnp.sqrt(x - 0.5), x),
            observe=lambda number, x: x,
            residual=difference,
            prior=Moments(np.array([1.0]), np.array([[1.0]])),
            noise_cov=np.array([[1.0]]),
            output_times=np.array([1.0, 2.0]),
            times=t,
            measurements=np.array([[0.5]]),
            key=KEY,
        )

    at_output = jax.jit(track)(np.array([0.5]))
    assert np.isfinite(at_output.mean[0]).all()
    assert np.isnan(at_output.mean[1]).all()
    at_measurement = jax.jit(track)(np.array([1.7]))
    assert np.isfinite(at_measurement.mean[0]).all()
    assert np.isnan(at_measurement.effective[1])
