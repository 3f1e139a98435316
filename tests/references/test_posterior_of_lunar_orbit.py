"""Claim: on the lunar orbit the posterior of the initial state is calibrated, and does not depend on units."""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import binom, chi2

from nlbench.moments.moments import Moments
from nlbench.references.initial_posterior import posterior_track
from nlbench.systems import kepler

KEY = jax.random.key(4)

# The 100-mile lunar orbit: nominal sightings on the first and third revolutions.
MU, MOON, RADIUS, SPEED = 1.66935e14, 5.7e6, 6.228e6, 5175.0
LUNAR = Moments(np.array([RADIUS, 0.0, 0.0, SPEED]), np.diag([1e6, 1e6, 1.0, 1.0]))
LUNAR_R = 1.6e-5
LANDMARKS = np.radians(np.repeat([89.0, 269.0, 89.0], 3))
SIGHTED = (
    (LANDMARKS + np.radians(np.tile([-8.0, 0.0, 9.0], 3)) + np.repeat([0, 0, 4 * math.pi], 3))
    * RADIUS
    / SPEED
)
SEEN = np.array([0.0, 1600.0, 6000.0, 16500.0, 20000.0])
RUNS = 400


def angle_of(landmark, x):
    return np.arctan2(MOON * np.sin(landmark) - x[..., 1], MOON * np.cos(landmark) - x[..., 0])


def wrapped(y, h):
    return y - h - 2 * math.pi * jnp.round((y - h) / (2 * math.pi))


def lunar_track(y, key, foot, second):
    """With lengths in units of `foot` feet and times in units of `second` seconds; key: of the rotations."""
    unit = jnp.array([foot, foot, foot / second, foot / second])
    R = MOON / foot

    def observe(number, x):
        landmark = jnp.asarray(LANDMARKS)[number]
        return jnp.arctan2(R * jnp.sin(landmark) - x[1], R * jnp.cos(landmark) - x[0])[None]

    return posterior_track(
        flow=lambda t, x: kepler.flow(t, x, MU * second**2 / foot**3),
        observe=observe,
        residual=wrapped,
        prior=Moments(LUNAR.mean / unit, LUNAR.cov / jnp.outer(unit, unit)),
        noise_cov=np.array([[LUNAR_R]]),
        output_times=SEEN / second,
        times=SIGHTED / second,
        measurements=y,
        key=key,
    )


lunar = jax.jit(jax.vmap(lunar_track, in_axes=(0, 0, None, None)))


@pytest.fixture(scope="module")
def lunar_runs():
    """True states (RUNS, T, 4) by numerical integration, measurements (RUNS, M, 1), and the reference's track."""
    g = np.random.default_rng(11)
    x0 = LUNAR.mean + g.normal(size=(RUNS, 4)) * np.sqrt(np.diag(LUNAR.cov))
    times = np.concatenate([SEEN, SIGHTED])
    order = np.argsort(times)

    def attraction(t, flat):
        x = flat.reshape(4, RUNS)
        return np.concatenate([x[2:], -MU * x[:2] / np.hypot(*x[:2]) ** 3]).ravel()

    solved = solve_ivp(
        attraction, (0, times.max()), x0.T.ravel(), "DOP853", t_eval=times[order], rtol=1e-10, atol=1e-6
    )
    states = np.empty((RUNS, len(times), 4))
    states[:, order] = solved.y.reshape(4, RUNS, -1).transpose(1, 2, 0)
    truth, sighted = states[:, : len(SEEN)], states[:, len(SEEN) :]
    y = angle_of(LANDMARKS, sighted) + math.sqrt(LUNAR_R) * g.normal(size=(RUNS, len(SIGHTED)))
    y = (np.remainder(y + math.pi, 2 * math.pi) - math.pi)[..., None]
    return truth, y, jax.tree.map(np.asarray, lunar(y, jax.random.split(KEY, RUNS), 1.0, 1.0))


def test_is_calibrated_on_the_lunar_orbit(lunar_runs):
    """Over 400 runs: the mean of e'P^-1 e, how often it is below the 90 % point of chi-square, the mean of the whitened
    errors and their squares; |z| < 4."""
    truth, _, track = lunar_runs
    for place in range(len(SEEN)):
        cov = track.cov[:, place]
        e = np.linalg.solve(np.linalg.cholesky(cov), (truth - track.mean)[:, place, :, None])[..., 0]
        nees = (e**2).sum(axis=1)
        for values, expected in (
            (nees, 4.0),
            *((e[:, i], 0.0) for i in range(4)),
            *((e[:, i] ** 2, 1.0) for i in range(4)),
        ):
            assert abs(values.mean() - expected) < 4 * values.std() / math.sqrt(RUNS)
        inside = (nees < chi2(4).ppf(0.9)).sum()
        assert abs(inside - 0.9 * RUNS) < 4 * binom(RUNS, 0.9).std()
    assert track.effective.min() > 0.99, "nearly normal in the initial state"


def test_units_do_not_matter(lunar_runs):
    """Feet and seconds, or the radius of the orbit and the time of an arc of one radian."""
    _, y, track = lunar_runs
    foot, second = RADIUS, RADIUS / SPEED
    scaled = lunar(y, jax.random.split(KEY, RUNS), foot, second)
    unit = np.array([foot, foot, foot / second, foot / second])
    spread = np.sqrt(np.diagonal(track.cov, axis1=-2, axis2=-1))
    assert (np.abs(scaled.mean * unit - track.mean) < 1e-6 * spread).all()
    outer = spread[..., :, None] * spread[..., None, :]
    assert (np.abs(scaled.cov * np.outer(unit, unit) - track.cov) < 1e-6 * outer).all()
