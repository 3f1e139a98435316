"""Claim: the exact reference of culver-scalar is Bayes' rule over initial conditions, and is calibrated."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle_culver import ENSEMBLES, ESCAPE, flow, posterior

OBSERVE = {"linear": lambda x: x, "quadratic": lambda x: 3 * x - 0.5 * x**2}


def build(**parameters):
    system = nb.systems.build("culver-scalar", **parameters)
    return system, nb.filters.build("exact", system)


def run(f, initial, times, y):
    """Moments after each update, and each update's info."""
    step = jax.jit(lambda state, t0, t1, value: f.update(f.predict(state, t0, t1), t1, value))
    state, previous = f.init(initial), 0.0
    for t, value in zip(times, y, strict=True):
        state, info = step(state, jnp.asarray(previous), jnp.asarray(t), jnp.asarray([value]))
        previous = t
        yield f.moments(state), info, state


@pytest.mark.parametrize("ensemble", ENSEMBLES)
@pytest.mark.parametrize("measurement", OBSERVE)
def test_posterior_is_quadrature_over_initial_conditions(ensemble, measurement):
    """320 midpoints against adaptive quadrature; at the law's cut-off the rule errs by 2e-4 of the spread."""
    system, f = build(ensemble=ensemble, measurement=measurement, measurement_variance=0.4)
    times, y = (0.1, 0.2, 0.3), (1.5, 2.4, 1.1)
    evidences = []
    for k, (moments, info, _) in enumerate(run(f, system.initial, times, y), start=1):
        mean, variance, third, fourth, evidence = posterior(
            ensemble, times[k - 1], times[:k], y[:k], OBSERVE[measurement], 0.4
        )
        scale = np.sqrt(variance)
        np.testing.assert_allclose(moments.mean, [mean], atol=3e-4 * scale)
        np.testing.assert_allclose(moments.cov, [[variance]], rtol=6e-4)
        np.testing.assert_allclose(np.ravel(moments.third), [third], atol=1e-3 * scale**3)
        np.testing.assert_allclose(np.ravel(moments.fourth), [fourth], rtol=1e-3)
        evidences.append(evidence)
        previous = evidences[-2] if k > 1 else 1.0
        np.testing.assert_allclose(info.log_likelihood, np.log(evidence / previous), atol=2e-4)


def test_between_measurements_the_moments_are_those_of_the_flow():
    system, f = build(measurement="none")
    state = f.predict(f.init(system.initial), 0.0, 0.7)
    mean, variance, third, fourth, _ = posterior("matched", 0.7, (), (), OBSERVE["linear"], 1.0)
    for mine, theirs in zip(f.moments(state), (mean, variance, third, fourth), strict=True):
        np.testing.assert_allclose(np.ravel(mine), [theirs], rtol=2e-4, atol=1e-6)


def test_rates_are_the_slope_of_the_moments():
    system, f = build()
    state = f.predict(f.init(system.initial), 0.0, 0.3)
    rates, h = f.rates(state, 0.3), 1e-4
    before = f.moments(f.predict(state, 0.3, 0.3 - h))
    after = f.moments(f.predict(state, 0.3, 0.3 + h))
    for rate, low, high in zip(rates, before, after, strict=True):
        np.testing.assert_allclose(rate, (high - low) / (2 * h), rtol=1e-6, atol=1e-8)


def test_a_missing_measurement_changes_nothing():
    system, f = build()
    state = f.predict(f.init(system.initial), 0.0, 0.1)
    after, info = f.update(state, 0.1, jnp.array([jnp.nan]))
    for mine, theirs in zip(f.moments(after), f.moments(state), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert float(info.log_likelihood) == 0.0


@pytest.mark.parametrize("y", [None, 0.9])
def test_points_that_have_escaped_carry_no_weight(y):
    """The printed ensemble at t = 1.8: moments over those of the grid's points that are still there."""
    system, f = build(ensemble="normal", measurement_variance=0.4)
    state = f.init(system.initial)
    x0, weights = np.asarray(system.exact.points), np.asarray(system.exact.weights)
    if y is not None:
        state, _ = f.update(f.predict(state, 0.0, 0.9), 0.9, jnp.array([y]))
        there = x0 < ESCAPE / (1 - np.exp(-1.8))
        weights = np.where(there, weights * np.exp(-0.5 * (y - flow(0.9, x0)) ** 2 / 0.4), 0.0)
    moments = f.moments(f.predict(state, 0.9, 1.8))
    there = x0 < ESCAPE / (1 - np.exp(-3.6))
    assert 0 < (~there).sum() < len(x0)
    x, w = flow(1.8, x0[there]), weights[there] / weights[there].sum()
    np.testing.assert_allclose(moments.mean, [w @ x], rtol=1e-12)
    np.testing.assert_allclose(moments.cov, [[w @ (x - w @ x) ** 2]], rtol=1e-11)


def test_estimated_moments_are_the_actual_ones():
    """Over 4,000 runs the errors' powers less the estimated moments average to zero, |z| < 4."""
    system, f = build(measurement_variance=0.16)
    times, runs = (0.1, 0.2, 0.3, 0.4, 0.5), 4000
    g = np.random.default_rng(5)
    x0 = ENSEMBLES["matched"].rvs(runs, random_state=g)
    truth = flow(times[-1], x0)
    y = np.stack([flow(t, x0) + 0.4 * g.normal(size=runs) for t in times], axis=1)

    def posterior_moments(y):
        state = f.init(system.initial)
        for k, t in enumerate(times):
            state, _ = f.update(f.predict(state, 0.0 if k == 0 else times[k - 1], t), t, y[k : k + 1])
        return f.moments(state)

    moments = jax.jit(jax.vmap(posterior_moments))(y)
    e = truth - np.asarray(moments.mean)[:, 0]
    v, s, q = (np.asarray(part).reshape(runs) for part in moments[1:])
    for difference in (e, e**2 - v, e**3 - s, e**4 - q, e**2 / v - 1):
        z = difference.mean() / (difference.std() / np.sqrt(runs))
        assert abs(z) < 4, z
    assert np.std(e) < 0.75 * np.std(truth), "the measurements must have told something"
