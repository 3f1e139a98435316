"""Claim: the reference that remembers its measurements is the Kalman filter on a linear system, also in the engine."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import expm

import nlbench as nb
from nlbench.systems.exact import InitialPosterior
from tests.oracle import kalman_update

A = np.array([[0.0, 1.0], [-1.0, -0.3]])
VALUES, VECTORS = np.linalg.eig(A)
H, R = np.array([[1.0, 0.4]]), np.array([[0.2]])
MEAN, COV = np.array([1.0, -0.5]), np.array([[0.5, 0.1], [0.1, 0.3]])
INTERVAL = 0.2
Y = np.array([[0.7], [np.nan], [-0.2]])


def flow(t, x):
    return jnp.real((VECTORS * jnp.exp(VALUES * t)) @ (np.linalg.inv(VECTORS) @ x))


def linear(most=5):
    return nb.System(
        drift=lambda t, x: jnp.asarray(A) @ x,
        observe=lambda t, x: jnp.asarray(H) @ x,
        measurement_cov=R,
        initial=nb.Moments(MEAN, COV),
        interval=INTERVAL,
        step=0.05,
        exact=InitialPosterior(flow, most=most),
    )


def kalman(count):
    """Mean and covariance after `count` intervals, those of NaN without a measurement."""
    Phi, m, P = expm(A * INTERVAL), MEAN, COV
    for y in Y[:count]:
        m, P = Phi @ m, Phi @ P @ Phi.T
        if not np.isnan(y).any():
            m, P = kalman_update(m, P, H, R, y - H @ m)
    return m, P


def after(f, count):
    step = jax.jit(lambda state, t, y: f.update(f.predict(state, t, t + INTERVAL), t + INTERVAL, y))
    state, info = f.init(f.system.initial), None
    for k in range(count):
        state, info = step(state, k * INTERVAL, Y[k])
    return state, info


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_moments_are_those_of_the_kalman_filter(count):
    f = nb.filters.build("exact", linear())
    moments = f.moments(after(f, count)[0])
    m, P = kalman(count)
    np.testing.assert_allclose(moments.mean, m, atol=1e-10)
    np.testing.assert_allclose(moments.cov, P, atol=1e-10)
    np.testing.assert_allclose(moments.third, 0, atol=1e-10)


def test_rates_are_those_of_the_linear_motion():
    f = nb.filters.build("exact", linear())
    rates, (m, P) = f.rates(after(f, 3)[0], 3 * INTERVAL), kalman(3)
    np.testing.assert_allclose(rates.mean, A @ m, atol=1e-9)
    np.testing.assert_allclose(rates.cov, A @ P + P @ A.T, atol=1e-9)


def test_an_update_tells_innovation_and_log_likelihood():
    f = nb.filters.build("exact", linear())
    info, (m, P) = after(f, 3)[1], kalman(2)
    Phi = expm(A * INTERVAL)
    m, P = Phi @ m, Phi @ P @ Phi.T
    z, s = Y[2] - H @ m, (H @ P @ H.T + R)[0, 0]
    np.testing.assert_allclose(info.innovation, z, atol=1e-9)
    np.testing.assert_allclose(info.innovation_cov, [[s]], atol=1e-9)
    expected = -0.5 * (z[0] ** 2 / s + np.log(2 * np.pi * s))
    np.testing.assert_allclose(info.log_likelihood, expected, atol=1e-9)


def test_more_measurements_than_there_is_room_for_are_not_hidden():
    f = nb.filters.build("exact", linear(most=2))
    assert np.isfinite(f.moments(after(f, 2)[0]).mean).all()
    assert np.isnan(f.moments(after(f, 3)[0]).mean).all()


def test_in_the_engine_it_is_the_linear_filter(tmp_path):
    """At every output time, those of measurements included; room is made for all measurements of the schedule."""
    results = nb.run(
        {
            "experiment": "remembered",
            "system": linear(most=1),
            "filters": ["ekf"],
            "reference": "exact",
            "time": {"end": 2.0, "step": 0.01, "output": 0.1},
            "monte_carlo": {"runs": 100, "seed": 2},
            "engine": {"cost": False},
        },
        tmp_path,
    )
    table = results.table("statistics")
    table = table[table.statistic.isin(["rms", "variance_estimated"])].set_index(
        ["filter", "time", "coordinate"]
    )
    one, other = (table.loc[label].value for label in ("ekf", "exact"))
    np.testing.assert_allclose(one, other, rtol=1e-6)  # RK4 steps of .01 against the flow
    assert len(one) > 80


@pytest.mark.long
def test_on_the_lunar_orbit_its_errors_are_what_it_says_they_are(tmp_path):
    """Joint NEES of 4 to 4 standard errors, and none of the filters does better in position."""
    results = nb.run(
        {
            "experiment": "reference",
            "system": {"name": "lunar-orbit"},
            "filters": ["linearised-kalman"],
            "reference": "exact",
            "time": {"end": 18_000, "step": 50, "output": 3_000},
            "monte_carlo": {"runs": 320, "seed": 8},
            "engine": {"cost": False},
        },
        tmp_path,
    )
    table = results.table("statistics")
    nees = table.query("filter == 'exact' and statistic == 'nees' and coordinate == 'all'")
    assert len(nees) >= 6
    assert (abs(nees.value - 4) < 4 * nees.stderr).all()
    rms = table.query("statistic == 'rms' and coordinate == 'position' and time == '18000.0'").set_index(
        "filter"
    )
    assert rms.value["exact"] < rms.value["linearised-kalman"]
