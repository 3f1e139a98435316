"""Claim: the second-order filters for discrete time reproduce the golden predictions and updates, noise Hessians
included, through the public interface."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.problems import assert_golden, golden, golden_ids


def expanded(x, value, slopes, xx=None, ww=None, xw=None, G=None):
    """(k, x', w) -> value + F e + L w + xx:ee/2 + ww:ww/2 + e xw w, e = x' - x; or + G(e) w for a function G."""
    F, L = slopes

    def function(k, x_, w):
        e = x_ - x
        y = jnp.asarray(value) + jnp.asarray(F) @ e
        if xx is not None:
            y = y + jnp.einsum("iab,a,b->i", xx, e, e) / 2
        if G is not None:
            return y + G(e) @ w
        y = y + jnp.asarray(L) @ w
        if ww is not None:
            y = y + jnp.einsum("ipq,p,q->i", ww, w, w) / 2
        return y if xw is None else y + jnp.einsum("iap,a,p->i", xw, e, w)

    return function


def athans_transition(c):
    return expanded(c["m"], c["f0"], (c["A"], c["L"]), c["Fk"], c["Gk"], c["Nk"])


def athans_observe(c):
    return expanded(c["m"], c["h0"], (c["C"], c["D"]), c["Mk"], c["Qk"], c["Rk"])


def additive(c):
    """The measurement of the second_order.update cases."""
    return expanded(c["m"], c["h"], (c["H"], jnp.eye(len(c["h"]))), c["hxx"])


@partial(jax.jit, static_argnums=(0, 1, 2))  # compiled once for all cases of one size
def predicted(name, transition, process_cov, c):
    """One prediction of a case's mean and covariance; transition: case -> function."""
    initial = nb.Moments(c["m"], c["P"])
    system = nb.DiscreteSystem(transition(c), lambda k, x, v: x[:1] + v, c[process_cov], np.eye(1), initial)
    f = nb.filters.build(name, system)
    return f.moments(f.predict(f.init(initial), 0, 1))


@partial(jax.jit, static_argnums=(0, 1, 2, 3))
def updated(name, observe, measurement_cov, y, c):
    """One update of a case's mean and covariance; observe: case -> function. With what it learned on the way."""
    initial = nb.Moments(c["m"], c["P"])
    system = nb.DiscreteSystem(
        lambda k, x, w: x + w, observe(c), jnp.zeros_like(c["P"]), c[measurement_cov], initial
    )
    f = nb.filters.build(name, system)
    state, info = f.update(f.init(initial), 0, c[y])
    return f.moments(state), info


def cases(*groups):
    return [
        pytest.param(name, inputs, outputs, id=f"{group}-{name}-{case_id}")
        for group, name in groups
        for case_id, inputs, outputs in golden(group)
    ]


ATHANS_PREDICT = (
    ("athans.predict/ekf", "ekf"),
    ("athans.predict/ekf", "linearised-kalman"),
    ("athans.predict/athans", "sof"),
    ("athans.predict/gaussian", "sof-gaussian"),
    ("athans.predict/gaussian", "ghkf"),
)


@pytest.mark.parametrize(("name", "c", "out"), cases(*ATHANS_PREDICT))
def test_prediction_with_noise_that_is_not_additive(name, c, out):
    """Gauss-Hermite sums of three points are exact for quadratic functions of a Gaussian, here of (x, w)."""
    moments = predicted(name, athans_transition, "Xi", c | {"m": np.zeros(len(c["P"]))})
    assert_golden(moments.mean, out["m"], "mean")
    assert_golden(moments.cov, out["P"], "cov")


ATHANS_UPDATE = (
    ("athans.update/ekf", "ekf"),
    ("athans.update/athans", "sof"),
    ("athans.update/gaussian", "sof-gaussian"),
    ("athans.update/gaussian", "ghkf"),
)


@pytest.mark.parametrize(("name", "c", "out"), cases(*ATHANS_UPDATE))
def test_update_with_noise_that_is_not_additive(name, c, out):
    moments, info = updated(name, athans_observe, "Theta", "z", c)
    assert_golden(moments.mean, out["m"], "mean")
    assert_golden(moments.cov, out["P"], "cov")
    assert_golden(info.innovation_cov, out["S"], "innovation_cov")


PREDICT = (
    ("second_order.predict/henriksen", "truncated"),
    ("second_order.predict/jazwinski", "truncated-jazwinski"),
    ("second_order.predict/jazwinski", "modified-jazwinski"),
)


def second_order_transition(c):
    def G(e):
        return (
            jnp.asarray(c["G"])
            + jnp.einsum("ijp,p->ij", c["Gx"], e)
            + jnp.einsum("ijpt,p,t->ij", c["Gxx"], e, e) / 2
        )

    return expanded(c["m"], c["f"], (c["F"], None), c["fxx"], G=G)


@pytest.mark.parametrize(("name", "c", "out"), cases(*PREDICT))
def test_truncated_prediction_with_noise_that_depends_on_the_state(name, c, out):
    moments = predicted(name, second_order_transition, "V", c)
    assert_golden(moments.mean, out["m"], "mean")
    assert_golden(moments.cov, out["P"], "cov")


@pytest.mark.parametrize(("name", "c", "out"), cases(("second_order.predict/gaussian", "sof-gaussian")))
def test_gaussian_prediction_leaves_out_only_the_curvature_of_the_noise(name, c, out):
    """The golden covariance holds (Q2 + Q2')/2, of third derivatives of the transition, which the filter does not
    take; Q2 of the case is formed here from its definition."""
    moments = predicted(name, second_order_transition, "V", c)
    Q2 = np.einsum("pt,jl,ijpt,ql->iq", c["P"], c["V"], c["Gxx"], c["G"])
    assert_golden(moments.mean, out["m"], "mean")
    assert_golden(moments.cov, out["P"] - (Q2 + Q2.T) / 2, "cov")


UPDATE = (
    ("second_order.update/ekf", "ekf"),
    ("second_order.update/henriksen", "truncated"),
    ("second_order.update/jazwinski_modified", "modified-jazwinski"),
    ("second_order.update/jazwinski_reconstructed", "truncated-jazwinski"),
    ("second_order.update/gaussian", "sof-gaussian"),
    ("second_order.update/gaussian", "ghkf"),
)


@pytest.mark.parametrize(("name", "c", "out"), cases(*UPDATE))
def test_update_of_a_quadratic_measurement(name, c, out):
    """Gauss-Hermite sums of three points are exact for quadratic functions of a Gaussian."""
    moments, info = updated(name, additive, "W", "y", c)
    assert_golden(moments.mean, out["m"], "mean")
    assert_golden(moments.cov, out["P"], "cov")
    assert_golden(info.innovation_cov, out["S"], "innovation_cov")


def test_every_golden_case_is_of_this_size():
    """Nine cases a group: a file cut short would leave claims unchecked."""
    assert {len(golden_ids(group)) for group, _ in (*ATHANS_PREDICT, *ATHANS_UPDATE, *PREDICT, *UPDATE)} == {
        9
    }
