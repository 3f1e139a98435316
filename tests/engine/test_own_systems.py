"""Claim: a System of the user's own runs like a built-in one, and its results are told from those of another."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import config
from nlbench.errors import ConfigError


def van_der_pol(damping=1.0, **changes):
    given = {
        "drift": lambda t, x: jnp.stack([x[1], damping * (1 - x[0] ** 2) * x[1] - x[0]]),
        "observe": lambda t, x: x[:1],
        "measurement_cov": np.array([[0.1]]),
        "initial": nb.Moments(mean=np.array([1.0, 0.0]), cov=0.1 * np.eye(2)),
        "interval": 0.2,
        **changes,
    }
    return nb.System(**given)


def run(system, out, **changes):
    stated = {
        "experiment": "van-der-pol",
        "filters": ["ekf", "second-order"],
        "time": {"end": 1.0, "step": 0.05, "output": 0.2},
        "monte_carlo": {"runs": 500},
        "engine": {"cost": False},
        **changes,
    }
    return nb.run({**stated, "system": system}, out)


def rms(results, label):
    table = results.table("statistics")
    row = table[(table["filter"] == label) & (table.time == "1.0") & (table.statistic == "rms")]
    return dict(zip(row.coordinate, row.value, strict=True))


def test_an_own_system_runs_and_its_results_read_back(tmp_path):
    results = run(van_der_pol(), tmp_path)
    assert set(rms(results, "ekf")) == {"x1", "x2"}
    assert rms(results, "ekf")["x1"] < 0.3
    assert results.experiment.system.name == "own"
    assert run(van_der_pol(), tmp_path).path == results.path


def test_another_system_gets_another_folder(tmp_path):
    assert run(van_der_pol(), tmp_path).path != run(van_der_pol(damping=2.0), tmp_path).path


def test_truth_may_differ_from_what_the_filters_believe(tmp_path):
    right = run(van_der_pol(damping=2.0), tmp_path)
    wrong = run(van_der_pol(damping=0.0, truth=van_der_pol(damping=2.0)), tmp_path)
    assert rms(wrong, "ekf")["x2"] > 1.2 * rms(right, "ekf")["x2"]


def test_process_noise_reaches_truth_and_filters(tmp_path):
    """A random walk, measured: the extended Kalman filter is the Kalman filter, so its variance is the true one."""
    walk = nb.System(
        drift=lambda t, x: 0.0 * x,
        observe=lambda t, x: x,
        measurement_cov=np.array([[1.0]]),
        initial=nb.Moments(mean=np.zeros(1), cov=np.eye(1)),
        diffusion=lambda t, x: jnp.eye(1),
        diffusion_cov=np.array([[4.0]]),
        interval=0.2,
    )
    table = run(walk, tmp_path, filters=["ekf"], monte_carlo={"runs": 4000}).table("statistics")
    row = table[(table.time == "1.0") & (table.coordinate == "x")].set_index("statistic")
    actual, estimated = row.loc["variance_actual"], row.loc["variance_estimated"]
    assert abs(actual.value - estimated.value) < 4 * actual.stderr
    assert estimated.value > 0.3


def test_named_own_without_a_system_says_how(tmp_path):
    with pytest.raises(ConfigError, match=r"nlbench\.System"):
        nb.run(config.from_dict({"experiment": "x", "system": "own", "filters": ["ekf"]}), tmp_path)
