"""Claims: the bound is the Kalman filter's covariance where all is linear, an independent recursion's elsewhere, and
no filter is below it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.engine.bounds import bounds_table
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.systems.own import recorded
from tests.small_runs import experiment


def stated(system, end, output, step=1, **changes):
    plain = {"system": {"name": "own", **recorded(system)}, "filters": ["ekf"], "reference": None, "report_times": None,
             "time": {"end": end, "step": step, "output": output}, **changes}  # fmt: skip
    return make(experiment(**plain), system)


def values(table, name):
    return table[table.coordinate == name].set_index("time").value


@pytest.mark.parametrize("singular", [False, True])
def test_a_linear_gaussian_system_has_the_kalman_covariance(singular):
    A = np.array([[0.9, 0.3], [-0.2, 0.8]])
    G = np.array([[0.0, 0.0], [0.5, 0.2]]) if singular else np.array([[0.4, 0.1], [0.5, 0.2]])
    H, R, P = np.array([[1.0, 0.5]]), np.array([[0.3]]), np.array([[1.0, 0.2], [0.2, 0.5]])
    system = nb.DiscreteSystem(
        transition=lambda k, x, w: jnp.asarray(A) @ x + jnp.asarray(G) @ w,
        observe=lambda k, x, v: jnp.asarray(H) @ x + v,
        process_cov=np.eye(2),
        measurement_cov=R,
        initial=nb.Moments([1.0, 2.0], P),
        interval=2,
    )
    table = bounds_table(stated(system, 12, 1), 3)
    assert list(table.columns) == ["time", "coordinate", "statistic", "value", "n"]
    assert set(table.statistic) == {"pcrb"}
    assert set(table.n) == {1024}
    for k in range(13):
        if k:
            P = A @ P @ A.T + G @ G.T
            if k % 2 == 0:
                P = P - P @ H.T @ np.linalg.inv(H @ P @ H.T + R) @ H @ P
        found = [values(table, name)[k] for name in ("x1", "x2")]
        np.testing.assert_allclose(found, np.sqrt(np.diagonal(P)), rtol=1e-10)


def test_without_process_noise_in_continuous_time_it_is_the_kalman_covariance_too():
    A, P0 = np.array([[0.0, 1.0], [-1.0, -0.4]]), np.diag([2.0, 0.5])
    system = nb.System(
        drift=lambda t, x: jnp.asarray(A) @ x,
        observe=lambda t, x: x[:1],
        measurement_cov=[[0.2]],
        initial=nb.Moments([1.0, 0.0], P0),
        interval=0.25,
    )
    table = bounds_table(stated(system, 2.0, 0.5, step=0.01), 3)
    values_, vectors = np.linalg.eig(A)
    information = np.linalg.inv(P0)
    for k in range(1, 9):
        Phi = (vectors @ np.diag(np.exp(values_ * 0.25 * k)) @ np.linalg.inv(vectors)).real
        information = information + Phi[:1].T @ Phi[:1] / 0.2
        if k % 2 == 0:
            expected = np.sqrt(np.diagonal(Phi @ np.linalg.inv(information) @ Phi.T))
            found = [values(table, name)[0.25 * k] for name in ("x1", "x2")]
            np.testing.assert_allclose(found, expected, rtol=1e-8)  # RK4 steps of 0.01


Q_GROWTH, P_GROWTH = 10.0, 5.0


def growth(**changes):
    """The univariate growth model (Gordon, Salmond and Smith 1993), observed through x^2 / 20."""
    known = {
        "transition": lambda k, x, w: 0.5 * x + 25 * x / (1 + x**2) + 8 * jnp.cos(1.2 * k) + w,
        "observe": lambda k, x, v: x**2 / 20 + v,
        "process_cov": [[Q_GROWTH]],
        "measurement_cov": [[1.0]],
        "initial": nb.Moments([0.0], [[P_GROWTH]]),
    }
    return nb.DiscreteSystem(**{**known, **changes})


@pytest.mark.parametrize("R", [1.0, 1000.0])
def test_a_scalar_nonlinear_system_has_tichavskys_recursion(R):
    """The oracle draws its own 400,000 truths; J+ = 1/Q + E H^2/R - (E F/Q)^2 / (J + E F^2/Q). Where little is
    measured, it is the transition that counts."""
    table = values(bounds_table(stated(growth(measurement_cov=[[R]]), 10, 1), 3), "x")
    rng = np.random.default_rng(1)
    blocks = 40
    Js, x = np.full(blocks, 1 / P_GROWTH), rng.normal(0, np.sqrt(P_GROWTH), (blocks, 10_000))
    for k in range(10):
        F = 0.5 + 25 * (1 - x**2) / (1 + x**2) ** 2
        x = 0.5 * x + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * k) + rng.normal(0, np.sqrt(Q_GROWTH), x.shape)
        H = x / 10
        ahead = (H**2).mean(1) / R + 1 / Q_GROWTH
        Js = ahead - (F.mean(1) / Q_GROWTH) ** 2 / (Js + (F**2).mean(1) / Q_GROWTH)
        spread = Js.std() * np.sqrt(10_000 / 1024)  # of 1,024 truths
        assert abs(table[k + 1] ** -2 - Js.mean()) < 4 * spread


def test_no_filter_is_below_the_bound(tmp_path):
    results = nb.run(
        {"experiment": "growth", "system": growth(), "filters": ["bootstrap", "ekf"], "bounds": ["cramer-rao"],
         "engine": {"cost": False}, "time": {"end": 6, "output": 1}, "monte_carlo": {"runs": 512, "seed": 3}},
        tmp_path,
    )  # fmt: skip
    bound = values(results.table("bounds"), "x")
    rows = results.table("statistics").query("statistic == 'rms' and time != 'all' and time != '0.0'")
    assert len(rows) == 12
    assert ((rows.value - rows.time.astype(float).map(bound)) / rows.stderr > -4).all()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"transition": lambda k, x, w: x + x * w}, "process noise depends on the state"),
        ({"observe": lambda k, x, v: x + v**3}, "measurement noise depends on the state"),
        ({"process_cov": [[0.0]]}, "nonlinear in states that have no noise"),
        ({"sample": lambda key: jnp.ones(1)}, "initial states are not normal"),
        ({"error": lambda x, m: x - m}, "errors are not differences"),
    ],
)
def test_where_there_is_no_bound_it_says_why(changes, why):
    with pytest.raises(ConfigError, match=why):
        bounds_table(stated(growth(**changes), 3, 1), 3)


def test_continuous_process_noise_is_refused():
    with pytest.raises(ConfigError, match="process noise in continuous time"):
        bounds_table(make(experiment(system={"name": "schwartz"}, filters=["kushner-2"], reference=None)), 3)
