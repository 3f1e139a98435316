"""Claim: between measurements the rates of orders 2, 3 and 4 are the golden ones (4.64)-(4.68)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle import fourth_moment
from tests.problems import assert_golden, golden, quadratic

NAMES = {2: ("second-order",), 3: ("third-order", "third-order-sub1"), 4: ("fourth-order", "third-order-4")}
CASES = [
    pytest.param(name, inputs, outputs, id=f"{name}-{case_id}")
    for order, names in NAMES.items()
    for name in names
    for case_id, inputs, outputs in golden(f"culver.autonomous{order}/exact_closure")
]


@pytest.mark.parametrize(("name", "inputs", "outputs"), CASES)
def test_rates_equal_the_golden_rates(name, inputs, outputs):
    mean, cov, third = inputs["m"], inputs["P"], inputs.get("S")
    fourth = fourth_moment(cov, inputs["k4"]) if "k4" in inputs else None
    n = len(mean)
    system = nb.System(
        drift=quadratic(mean, inputs["f"], inputs["F"], inputs["A"]),
        observe=lambda t, x: x,
        measurement_cov=np.eye(n),
        initial=nb.Moments(mean, cov, third, fourth),
        diffusion=lambda t, x: jnp.eye(n),
        diffusion_cov=inputs["V"],
    )
    f = nb.filters.build(name, system)
    rates = f.rates(f.init(system.initial), 0.0)
    for key, value in zip(
        ("dm", "dP", "dS", "dmu4"), (rates.mean, rates.cov, rates.third, rates.fourth), strict=True
    ):
        if key in outputs:
            assert_golden(value, outputs[key], key)
