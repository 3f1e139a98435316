"""Claim: every moment filter is Kalman's on a linear system, symmetric, traced once, equal under vmap; where a filter
does not apply it says so."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import permutations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from nlbench.filters.catalogue import FILTERS, row
from nlbench.systems.discrete import DiscreteSystem
from tests.oracle import kalman_predict_rk4, kalman_update, random_cov, rng, symmetrise
from tests.problems import assert_vmap_equals_a_loop, dense

NAMES = [name for name, row in FILTERS.items() if row.family == "moment"]
OTHERS = sorted(set(FILTERS) - set(NAMES))
# Updates that integrate in pseudo-time agree with the Kalman filter as far as their steps do, with an error of order 4.
FINE = {"integration-update": {"steps": 400}}
# Those with updates that look beyond the linearised measurement compile for minutes, all together.
CURVED = ("series", "tempering", "two-step", "direct", "quadrature")
EVERY = pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.long if FILTERS[name].update in CURVED else ()) for name in NAMES],
)
F = np.array([[0.0, 1.0], [-1.0, -0.3]])
C = np.array([0.2, 0.0])
G = np.array([[0.0], [0.8]])
V = np.array([[0.5]])
H = np.array([[1.0, 0.4]])
R = np.array([[0.2]])
START = nb.Moments(np.array([1.0, -0.5]), np.array([[0.5, 0.1], [0.1, 0.3]]))
STEP, INTERVAL, SAMPLES = 0.05, 0.2, 6
Y = np.cos(np.arange(1, SAMPLES + 1))


def linear():
    return nb.System(
        drift=lambda t, x: jnp.asarray(F) @ x + C,
        observe=lambda t, x: jnp.asarray(H) @ x,
        measurement_cov=R,
        initial=START,
        diffusion=lambda t, x: jnp.asarray(G),
        diffusion_cov=V,
        step=STEP,
    )


def nonlinear(cov=0.2, noise=0.5, measurement=lambda t, x: x[:1]):
    g = rng(1)
    third = 0.01 * symmetrise(g.normal(size=(2, 2, 2)))
    return nb.System(
        drift=lambda t, x: jnp.stack([x[1], -x[0] - 0.4 * x[1] * x[0] ** 2]),
        observe=measurement,
        measurement_cov=np.atleast_2d(noise),
        initial=nb.Moments(np.array([1.0, 0.5]), cov * np.eye(2) + 0.05, third),
        diffusion=lambda t, x: jnp.stack([jnp.zeros(1), 0.3 + 0.1 * x[:1]]),
        diffusion_cov=np.eye(1),
        step=STEP,
    )


def cycle(f):
    """(state, t, y) -> the state after one interval and one update."""

    def step(state, t, y):
        return f.update(f.predict(state, t, t + INTERVAL), t + INTERVAL, y)

    return step


@cache
def nonlinear_filter(name):
    """A filter of the nonlinear system, its compiled cycle, and a list that grows with every trace of it."""
    f, traces = nb.filters.build(name, nonlinear()), []

    def step(state, t, y):
        traces.append(name)
        return cycle(f)(state, t, y)

    return f, jax.jit(step), traces


def at(k, y=0.7):
    """Arguments of the k-th cycle, of one type throughout."""
    return jnp.asarray(k * INTERVAL), jnp.asarray([y])


@EVERY
def test_equals_the_kalman_filter_on_a_linear_system(name):
    """Against RK4 steps and information-form updates in NumPy, and the log-likelihood of the innovations."""
    f = nb.filters.build(name, linear(), **FINE.get(name, {}))
    step = jax.jit(cycle(f))
    state, (m, p) = f.init(START), (np.asarray(START.mean), np.asarray(START.cov))
    for k in range(SAMPLES):
        t = k * INTERVAL
        state, info = step(state, t, Y[k : k + 1])
        m, p = kalman_predict_rk4(m, p, F, C, G @ V @ G.T, t, t + INTERVAL, round(INTERVAL / STEP))
        s = (H @ p @ H.T + R)[0, 0]
        z = Y[k] - (H @ m)[0]
        m, p = kalman_update(m, p, H, R, np.array([z]))
        np.testing.assert_allclose(info.innovation, [z], atol=1e-10)
        np.testing.assert_allclose(info.innovation_cov, [[s]], atol=1e-10)
        np.testing.assert_allclose(
            info.log_likelihood, -0.5 * (z * z / s + np.log(2 * np.pi * s)), atol=1e-10
        )
        np.testing.assert_allclose(info.nu, 0.0, atol=1e-10)
        assert not bool(info.guarded)
    moments = f.moments(state)
    np.testing.assert_allclose(moments.mean, m, atol=1e-10)
    np.testing.assert_allclose(moments.cov, p, atol=1e-10)
    if moments.third is not None:
        np.testing.assert_allclose(moments.third, 0, atol=1e-10)
    if moments.fourth is not None:
        np.testing.assert_allclose(moments.fourth, 3 * symmetrise(np.multiply.outer(p, p)), atol=1e-10)


@EVERY
def test_moments_come_back_as_they_were_given(name):
    """Of mean, cov and third: what the filter carries is returned, what it does not is None."""
    system = nonlinear()
    f = nb.filters.build(name, system)
    moments = f.moments(f.init(system.initial))
    np.testing.assert_array_equal(moments.mean, system.initial.mean)
    np.testing.assert_array_equal(moments.cov, system.initial.cov)
    if moments.third is not None:
        np.testing.assert_array_equal(moments.third, system.initial.third)


@EVERY
def test_a_measurement_without_information_changes_nothing(name):
    system = nonlinear(noise=1e14)
    f = nb.filters.build(name, system)
    before = f.init(system.initial)
    after, _ = f.update(before, 0.0, np.array([2.0]))
    for mine, theirs in zip(dense(f.moments(after)), dense(f.moments(before)), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, atol=1e-12)


@EVERY
def test_moments_are_exactly_symmetric(name):
    f, step, _ = nonlinear_filter(name)
    state = f.init(f.system.initial)
    for k in range(3):
        state, _ = step(state, *at(k))
    _, cov, third, fourth = dense(f.moments(state))
    for array in (cov, third, fourth):
        if array is not None:
            for order in permutations(range(array.ndim)):
                np.testing.assert_array_equal(array, array.transpose(order))


@EVERY
def test_a_loop_is_traced_once(name):
    """The state keeps its structure and types through updates, begun with or without higher moments."""
    f, step, traces = nonlinear_filter(name)
    for start in (f.system.initial, nb.Moments(*f.system.initial[:2])):
        state = f.init(start)
        for k in range(3):
            state, _ = step(state, *at(k))
    assert len(traces) == 1


@EVERY
def test_a_scan_carries_the_state(name):
    f, step, _ = nonlinear_filter(name)
    y = jnp.array([[0.7], [jnp.nan], [0.2]])
    start, times = f.init(f.system.initial), jnp.arange(3) * INTERVAL
    state, _ = jax.jit(lambda s: jax.lax.scan(lambda s, k: (cycle(f)(s, *k)[0], None), s, (times, y)))(start)
    other = start
    for t, value in zip(times, y, strict=True):
        other, _ = step(other, t, value)
    for mine, theirs in zip(dense(f.moments(state)), dense(f.moments(other)), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, rtol=1e-13, atol=1e-14)


@EVERY
def test_vmap_equals_a_loop(name):
    f, _, _ = nonlinear_filter(name)
    g = rng(2)
    starts = [
        f.init(
            nb.Moments(g.normal(size=2), 0.2 * random_cov(g, 2), 0.01 * symmetrise(g.normal(size=(2, 2, 2))))
        )
        for _ in range(5)
    ]
    y = jnp.asarray(g.normal(size=(5, 1)))
    assert_vmap_equals_a_loop(cycle(f), starts, jnp.asarray(0.0), y, rtol=1e-12, atol=1e-13)


@EVERY
def test_eager_and_compiled_runs_agree(name):
    f, step, _ = nonlinear_filter(name)
    args = f.init(f.system.initial), *at(0)
    (eager, info), (compiled, info2) = cycle(f)(*args), step(*args)
    for mine, theirs in zip(dense(f.moments(eager)), dense(f.moments(compiled)), strict=True):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(info.log_likelihood, info2.log_likelihood, rtol=1e-11)


@EVERY
def test_rates_are_the_slope_of_predict(name):
    """(moments(h) - moments(0)) / h approaches rates as h -> 0, to first order in h."""
    system = nonlinear()
    f = nb.filters.build(name, system)
    state = f.init(system.initial)
    rates, start = dense(f.rates(state, 0.0)), dense(f.moments(state))
    gaps = []
    for h in (1e-3, 5e-4):
        end = dense(nb.filters.build(name, system, step=h).moments(f.predict(state, 0.0, h)))
        pairs = [((b - a) / h, r) for a, b, r in zip(start, end, rates, strict=True) if b is not None]
        gaps.append(max(np.abs(slope - rate).max() for slope, rate in pairs))
    assert gaps[0] < 0.05
    assert gaps[1] < 0.55 * gaps[0]


@EVERY
def test_diverging_numbers_become_nan_and_raise_nothing(name):
    """A state that overflows stays non-finite; the engine counts it."""
    system = nb.System(
        drift=lambda t, x: x**3,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments([50.0], [[1.0]]),
        step=0.1,
    )
    f = nb.filters.build(name, system)
    state, _ = f.update(f.predict(f.init(system.initial), 0.0, 2.0), 2.0, np.array([1.0]))
    assert not np.isfinite(np.asarray(f.moments(state).mean)).all()


def test_every_name_of_the_contract_that_moments_need_is_registered():
    wanted = {
        "linearised-kalman", "ekf", "second-order", "third-order", "third-order-sub1", "third-order-sub2",
        "third-order-guarded", "third-order-4", "fourth-order", "fourth-order-guarded", "series-3", "series-4",
        "integration-update", "two-step-2", "two-step-3", "direct-2", "direct-3", "quadrature-2", "quadrature-3",
        "exact",
    }  # fmt: skip
    assert wanted <= set(nb.filters.available())


@pytest.mark.parametrize("name", [name for name in NAMES if row(name, continuous=True).family == "moment"])
def test_a_continuously_measured_system_is_refused_by_name(name):
    with pytest.raises(ConfigError, match=f"{name}: .*continuous"):
        nb.filters.build(name, replace(linear(), measurement="continuous"))


@pytest.mark.parametrize("name", [name for name in NAMES if row(name, discrete=True).family == "moment"])
def test_a_system_in_discrete_time_is_refused_by_name(name):
    system = DiscreteSystem(lambda k, x, w: x + w, lambda k, x, v: x[:1] + v, 0.1 * np.eye(2), R, START)
    with pytest.raises(ConfigError, match=f"{name}: .*discrete"):
        nb.filters.build(name, system)


@pytest.mark.parametrize("name", OTHERS)
def test_a_filter_of_another_family_applies_or_is_refused_by_name(name):
    refusal = name
    try:
        nb.filters.build(name, linear())
    except ConfigError as error:
        refusal = str(error)
    assert name in refusal


@pytest.mark.parametrize(
    "name", [name for name in NAMES if name.startswith(("series", "two-step", "quadrature"))]
)
def test_an_update_that_is_not_linear_at_all_has_no_nonlinear_part_to_limit(name):
    with pytest.raises(ConfigError, match="limiter_scope"):
        nb.filters.build(name, linear(), limiter_scope="nonlinear")


def test_ekf_is_another_name_of_the_linearised_kalman_filter():
    system = nonlinear()
    results = []
    for name in ("ekf", "linearised-kalman"):
        f = nb.filters.build(name, system)
        state, _ = jax.jit(cycle(f))(f.init(system.initial), 0.0, np.array([0.7]))
        results.append(dense(f.moments(state)))
    for mine, theirs in zip(*results, strict=True):
        np.testing.assert_array_equal(mine, theirs)


@pytest.mark.parametrize(
    "bad", [{"limitr": 3}, {"limiter": -1.0}, {"guard": "sub2"}, {"limiter_scope": "linear"}]
)
def test_options_that_do_not_exist_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        nb.filters.build("third-order", linear(), **bad)


def test_an_unknown_name_is_refused_with_the_closest_one():
    with pytest.raises(ConfigError, match="did you mean 'third-order'"):
        nb.filters.build("thrid-order", linear())


def test_a_system_without_an_exact_posterior_is_told_so():
    with pytest.raises(ConfigError, match="exact"):
        nb.filters.build("exact", linear())
