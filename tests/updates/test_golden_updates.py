"""Claim: named filters reproduce the golden posteriors of Table 5.1, limited forms and fourth order."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracle import fourth_moment
from tests.problems import assert_golden, golden, golden_ids, linear_measurement, updated


def cases(*groups):
    """One test parameter for each case of each (group, filter name, options)."""
    return [
        pytest.param(name, options(inputs), inputs, outputs, id=f"{group}-{name}-{case_id}")
        for group, name, options in groups
        for case_id, inputs, outputs in golden(group)
    ]


def posterior(name, inputs, fourth=None, **options):
    system = linear_measurement(inputs["m"], inputs["P"], inputs["H"], inputs["R"], inputs["S"], fourth)
    return updated(name, system, inputs["H"] @ inputs["m"] + inputs["z"], **options)


def none(inputs):
    return {}


def limit(scope):
    return lambda inputs: {"limiter": float(inputs["c"]), "limiter_scope": scope}


THIRD_ORDER = (
    ("culver.table51/optimal", "third-order", none),
    ("culver.table51/sub1", "third-order-sub1", none),
    ("culver.table51/sub2", "third-order-sub2", none),
    ("culver.table51/optimal", "third-order-4", none),
    ("culver.table51_limited/all", "third-order", limit("all")),
    ("culver.table51_limited/nonlinear_only", "third-order", limit("nonlinear")),
)


@pytest.mark.parametrize(("name", "options", "inputs", "outputs"), cases(*THIRD_ORDER))
def test_third_order_posterior_is_table_51(name, options, inputs, outputs):
    moments, info = posterior(name, inputs, **options)
    assert_golden(moments.mean, outputs["m"], "mean")
    assert_golden(moments.cov, outputs["P"], "cov")
    assert_golden(moments.third, outputs["S"], "third")
    if "nu" in outputs:
        assert_golden(info.nu, outputs["nu"], "nu")


@pytest.mark.parametrize(
    ("name", "options", "inputs", "outputs"), cases(("hermite4.update/exact", "fourth-order", none))
)
def test_fourth_order_posterior_is_the_exact_hermite_update(name, options, inputs, outputs):
    moments, info = posterior(name, inputs, fourth_moment(inputs["P"], inputs["k4"]))
    assert_golden(moments.mean, outputs["m"], "mean")
    assert_golden(moments.cov, outputs["P"], "cov")
    assert_golden(moments.third, outputs["S"], "third")
    assert_golden(moments.fourth, outputs["mu4"], "mu4")
    k4 = np.asarray(moments.fourth) - fourth_moment(np.asarray(moments.cov))
    np.testing.assert_allclose(k4, outputs["k4"], rtol=1e-10, atol=1e-10 * np.abs(outputs["mu4"]).max())
    assert_golden(info.nu, outputs["nu"], "nu")


@pytest.mark.parametrize("case_id", golden_ids("culver.limiter/all"))
def test_limiter_clips_the_residual_at_so_many_predicted_sigmas(case_id):
    inputs, outputs = next((i, o) for key, i, o in golden("culver.limiter/all") if key == case_id)
    n = len(inputs["P"])
    inputs |= {"m": np.zeros(n), "S": np.zeros((n, n, n))}
    moments, _ = posterior("third-order", inputs, limiter=float(inputs["c"]))
    h, p = inputs["H"], inputs["P"]
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + inputs["R"])
    used = np.linalg.lstsq(gain, np.asarray(moments.mean), rcond=None)[0]
    assert_golden(used, outputs["z"], "residual used")
