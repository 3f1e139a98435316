"""Claim: filters of continuous measurements are Kalman's and Bucy's on a linear system, and step by Euler's rule."""

from __future__ import annotations

from functools import cache
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from nlbench.filters import catalogue
from tests.oracle import hermite_density, outer, placements, random_cov, rng, symmetrise
from tests.problems import assert_vmap_equals_a_loop, dense

pytestmark = pytest.mark.long  # minutes of compiling, all filters together

NAMES = [
    name for name in nb.filters.available() if catalogue.row(name, continuous=True).family == "continuous"
]
OTHERS = [
    name
    for name in nb.filters.available()
    if catalogue.row(name, continuous=True).family in ("moment", "discrete")
]
EVERY = pytest.mark.parametrize("name", NAMES)
F = np.array([[0.0, 1.0], [-1.0, -0.3]])
G = np.array([[0.0], [0.8]])
V = np.array([[0.5]])
H = np.array([[1.0, 0.4], [0.2, -0.7]])
GAMMA = np.array([[0.2, 0.05], [0.05, 0.3]])
START = nb.Moments(np.array([1.0, -0.5]), np.array([[0.5, 0.1], [0.1, 0.3]]))
STEP = 0.01


def linear(**changed):
    given = {
        "drift": lambda t, x: jnp.asarray(F) @ x,
        "observe": lambda t, x: jnp.asarray(H) @ x,
        "measurement_cov": GAMMA,
        "initial": START,
        "diffusion": lambda t, x: jnp.asarray(G),
        "diffusion_cov": V,
        "measurement": "continuous",
        "step": STEP,
    }
    return nb.System(**(given | changed))


def nonlinear(observe=lambda t, x: jnp.stack([x[0] + 0.3 * x[1] ** 2, x[1] * x[0]]), gamma=GAMMA):
    g = rng(1)
    return nb.System(
        drift=lambda t, x: jnp.stack([x[1], -x[0] - 0.4 * x[1] * x[0] ** 2]),
        observe=observe,
        measurement_cov=gamma,
        initial=nb.Moments(
            np.array([1.0, 0.5]),
            0.2 * np.eye(2) + 0.05,
            0.01 * symmetrise(g.normal(size=(2, 2, 2))),
            placements(3, 0.2 * np.eye(2) + 0.05, 0.2 * np.eye(2) + 0.05)
            + 0.01 * symmetrise(g.normal(size=(2, 2, 2, 2))),
        ),
        diffusion=lambda t, x: jnp.stack([jnp.zeros(1), 0.3 + 0.1 * x[:1]]),
        measurement="continuous",
        step=STEP,
    )


@cache
def nonlinear_filter(name):
    """A filter of the nonlinear system, its compiled update, and a list that grows with every trace of it."""
    f, traces = nb.filters.build(name, nonlinear()), []

    def step(state, t, y):
        traces.append(name)
        return f.update(state, t, y)

    return f, jax.jit(step), traces


def at(k, y=(0.7, -0.3)):
    """Arguments of the k-th update, of one type throughout."""
    return jnp.asarray(k * STEP), jnp.asarray(y)


def assert_same(f, mine, theirs, **tolerance):
    for a, b in zip(dense(f.moments(mine)), dense(f.moments(theirs)), strict=True):
        if b is not None:
            np.testing.assert_allclose(a, b, **tolerance)


@EVERY
def test_equals_the_kalman_bucy_filter_on_a_linear_system(name):
    """Against Euler's steps of m' = F m + P H' W (y - H m), P' = F P + P F' + G V G' - P H' W H P in NumPy."""
    options = {"nominal": [0.0, 0.0]} if name == "schwartz-1" else {}
    f = nb.filters.build(name, linear(), **options)
    step, w = jax.jit(f.update), np.linalg.inv(GAMMA)
    state, m, p = f.init(START), np.asarray(START.mean), np.asarray(START.cov)
    for k, y in enumerate(rng(5).normal(size=(60, 2)) @ np.linalg.cholesky(GAMMA / STEP).T):
        state, info = step(state, k * STEP, y)
        nu = y - H @ m
        np.testing.assert_allclose(info.innovation, nu, atol=1e-10)
        np.testing.assert_allclose(info.innovation_cov, GAMMA / STEP, atol=1e-10)
        _, determinant = np.linalg.slogdet(2 * np.pi * GAMMA / STEP)
        np.testing.assert_allclose(info.log_likelihood, -0.5 * (STEP * nu @ w @ nu + determinant), atol=1e-10)
        gain = p @ H.T @ w
        m, p = m + STEP * (F @ m + gain @ nu), p + STEP * (F @ p + p @ F.T + G @ V @ G.T - gain @ H @ p)
    moments = f.moments(state)
    np.testing.assert_allclose(moments.mean, m, atol=1e-10)
    np.testing.assert_allclose(moments.cov, p, atol=1e-10)
    if moments.third is not None:
        np.testing.assert_allclose(moments.third, 0, atol=1e-10)
    if moments.fourth is not None:
        np.testing.assert_allclose(moments.fourth, placements(3, p, p), atol=1e-10)


@EVERY
def test_an_update_is_one_step_of_euler(name):
    """Of mean, covariance and third moment; the fourth has a test of its own."""
    f, step, _ = nonlinear_filter(name)
    state = f.init(f.system.initial)
    rates, before = dense(f.rates(state, *at(3))), dense(f.moments(state))
    after = dense(f.moments(step(state, *at(3))[0]))
    for a, b, rate in list(zip(after, before, rates, strict=True))[:3]:
        if b is not None:
            np.testing.assert_allclose(a, b + STEP * rate, rtol=1e-12, atol=1e-13)


def test_the_step_of_the_fourth_coefficient_is_in_itos_sense():
    """k4 = mu4 - 3{P P}: d k4 = d mu4 - 6{P dP} - 3{c_ij W c_kl} dt, with c = cov(ee, h) of the assumed density."""
    observe = [lambda x: x[0] + 0.3 * x[1] ** 2, lambda x: x[1] * x[0]]
    f = nb.filters.build("kushner-4", nonlinear())
    mean, cov, third, fourth = f.system.initial
    state = f.init(f.system.initial)
    density = hermite_density(mean, cov, third, fourth - placements(3, cov, cov))
    c = [
        density.mean_of(lambda x, h=h: (outer(x - mean, x - mean) - cov) * h(x)) for h in observe
    ]  # h is quadratic, so this is what its expansion gives
    w = np.linalg.inv(GAMMA)
    spread = sum(w[r, s] * placements(3, c[r], c[s]) for r in range(2) for s in range(2))
    rates = dense(f.rates(state, *at(0)))
    k4_rate = rates[3] - placements(6, cov, rates[1]) - spread
    after = dense(f.moments(f.update(state, *at(0))[0]))
    k4 = fourth - placements(3, cov, cov) + STEP * k4_rate
    np.testing.assert_allclose(after[3], k4 + placements(3, after[1], after[1]), rtol=1e-11, atol=1e-13)


def test_cumulants_decay_as_they_do_in_exact_filtering():
    """At rest, y = H x: d kappa_4 = kappa_5 H dnu/Gamma - (4 kappa_2 kappa_4 + 3 kappa_3^2) H^2 dt/Gamma exactly."""
    p, s, k4, slope, gamma = 0.5, 0.2, 0.1, 1.3, 0.4
    start = nb.Moments([0.7], [[p]], [[[s]]], np.full((1,) * 4, k4 + 3 * p * p))
    f = nb.filters.build(
        "kushner-4",
        nb.System(
            drift=lambda t, x: jnp.zeros(1),
            observe=lambda t, x: slope * x,
            measurement_cov=[[gamma]],
            initial=start,
            measurement="continuous",
            step=STEP,
        ),
    )
    after = []
    for y in (slope * 0.7 + 3.0, slope * 0.7 - 8.0):
        moments = f.moments(f.update(f.init(start), 0.0, np.array([y]))[0])
        after.append(float(moments.fourth[0, 0, 0, 0] - 3 * moments.cov[0, 0] ** 2))
    decay = (4 * p * k4 + 3 * s * s) * slope**2 / gamma
    np.testing.assert_allclose(after, k4 - STEP * decay, rtol=1e-12)


@EVERY
def test_without_information_the_step_is_autonomous(name):
    f = nb.filters.build(name, nonlinear(gamma=1e14 * GAMMA))
    start = f.init(f.system.initial)
    after, _ = f.update(start, 0.0, np.array([2.0, -1.0]))
    missing, info = f.update(start, 0.0, np.array([np.nan, np.nan]))
    assert_same(f, after, missing, atol=1e-12)
    assert_same(f, missing, start, atol=0.1)
    np.testing.assert_allclose(info.log_likelihood, 0.0, atol=1e-12)
    rates, autonomous = f.rates(start, 0.0, np.array([np.nan, np.nan])), f.rates(start, 0.0)
    for mine, theirs in zip(dense(rates), dense(autonomous), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, atol=1e-12)


@EVERY
def test_a_missing_entry_leaves_the_other_alone(name):
    """Against the system that has only the other measurement, whose noise has the marginal density."""
    f, step, _ = nonlinear_filter(name)
    alone = nb.filters.build(name, nonlinear(observe=lambda t, x: (x[1] * x[0])[None], gamma=GAMMA[1:, 1:]))
    start = f.init(f.system.initial)
    both, info = step(start, *at(0, (np.nan, -0.3)))
    one, info1 = alone.update(start, 0.0, np.array([-0.3]))
    assert_same(f, both, one, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(info.log_likelihood, info1.log_likelihood, rtol=1e-12)
    np.testing.assert_allclose(info.innovation, [0.0, info1.innovation[0]], rtol=1e-12)


@EVERY
def test_missing_false_gives_the_same_where_nothing_is_missing(name):
    f, step, _ = nonlinear_filter(name)
    g = nb.filters.build(name, nonlinear(), missing=False)
    start = f.init(f.system.initial)
    assert_same(f, step(start, *at(0))[0], g.update(start, *at(0))[0], rtol=1e-12, atol=1e-13)


@EVERY
def test_moments_are_exactly_symmetric(name):
    f, step, _ = nonlinear_filter(name)
    state = f.init(f.system.initial)
    for k in range(3):
        state, _ = step(state, *at(k))
    for array in dense(f.moments(state))[1:]:
        if array is not None:
            for order in permutations(range(array.ndim)):
                np.testing.assert_array_equal(array, array.transpose(order))


@EVERY
def test_a_loop_is_traced_once_and_a_scan_carries_the_state(name):
    f, step, traces = nonlinear_filter(name)
    y = jnp.array([[0.7, -0.3], [jnp.nan, 0.1], [0.2, 0.4]])
    start, times = f.init(f.system.initial), jnp.arange(3) * STEP
    state, _ = jax.jit(lambda s: jax.lax.scan(lambda s, k: (f.update(s, *k)[0], None), s, (times, y)))(start)
    other = start
    for t, value in zip(times, y, strict=True):
        other, _ = step(other, t, value)
    step(f.init(nb.Moments(*f.system.initial[:2])), *at(0))
    assert len(traces) == 1
    assert_same(f, state, other, rtol=1e-12, atol=1e-13)


@EVERY
def test_vmap_equals_a_loop(name):
    f, _, _ = nonlinear_filter(name)
    g = rng(2)
    starts = [f.init(nb.Moments(g.normal(size=2), 0.2 * random_cov(g, 2))) for _ in range(3)]
    y = jnp.asarray(g.normal(size=(3, 2)))
    assert_vmap_equals_a_loop(f.update, starts, jnp.asarray(0.0), y, rtol=1e-11, atol=1e-12)


@EVERY
def test_predict_is_refused_by_name(name):
    f, _, _ = nonlinear_filter(name)
    with pytest.raises(ConfigError, match=f"{name}: .*continuous"):
        f.predict(f.init(f.system.initial), 0.0, 1.0)


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith(("kushner", "schwartz"))])
def test_measurements_at_discrete_times_are_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"{name}: .*discrete"):
        nb.filters.build(name, linear(measurement="discrete", interval=0.1))


@pytest.mark.parametrize("name", OTHERS)
def test_filters_of_discrete_measurements_refuse_continuous_ones(name):
    with pytest.raises(ConfigError, match=name):
        nb.filters.build(name, linear())


def test_a_filter_without_a_step_asks_for_one():
    with pytest.raises(ConfigError, match=r"kushner-2: .*step"):
        nb.filters.build("kushner-2", linear(step=None))
    assert nb.filters.build("kushner-2", linear(step=None), step=0.1)
