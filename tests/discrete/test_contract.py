"""Claim: every filter for discrete time is Kalman's on a linear system, symmetric, traced once, equal under vmap, and
takes a NaN as not measured; on systems in continuous time as well."""

from __future__ import annotations

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.discrete.catalogue import ROWS
from nlbench.errors import ConfigError
from nlbench.filters.catalogue import options as options_of
from tests.oracle import kalman_predict_rk4, kalman_update, random_cov, rng
from tests.oracle_extended import transition
from tests.problems import assert_vmap_equals_a_loop

pytestmark = pytest.mark.long  # minutes of compiling, all filters together

SAMPLING = {"ensemble": {"particles": 4000}, "bootstrap": {"particles": 4000}}
EXACT = [name for name in ROWS if name not in SAMPLING]
EVERY = pytest.mark.parametrize("name", ROWS)
NONLINEAR = pytest.mark.parametrize("name", [name for name in ROWS if name != "kalman"])
A = np.array([[0.9, 0.2], [-0.1, 0.8]])
L = np.array([[1.0, 0.0], [0.3, 1.0]])
Q = np.array([[0.2, 0.05], [0.05, 0.1]])
H = np.array([[1.0, 0.4], [0.2, -1.0]])
D = np.array([[1.0, 0.5], [0.0, 2.0]])
R = np.array([[0.3, 0.1], [0.1, 0.2]])
START = nb.Moments(np.array([1.0, -0.5]), np.array([[0.5, 0.1], [0.1, 0.3]]))
Y = np.stack([np.cos(np.arange(1, 5)), np.sin(np.arange(1, 5))], 1)
F = np.array([[0.0, 1.0], [-1.0, -0.3]])
G = np.array([[0.0], [0.8]])
V = np.array([[0.5]])
STEP, INTERVAL = 0.05, 0.2


def linear():
    return nb.DiscreteSystem(
        transition=lambda k, x, w: jnp.asarray(A) @ x + jnp.asarray(L) @ w + 0.1 * k,
        observe=lambda k, x, v: jnp.asarray(H) @ x + jnp.asarray(D) @ v,
        process_cov=Q,
        measurement_cov=R,
        initial=START,
    )


def linear_in_continuous_time():
    return nb.System(
        drift=lambda t, x: jnp.asarray(F) @ x,
        observe=lambda t, x: jnp.asarray(H) @ x,
        measurement_cov=R,
        initial=START,
        diffusion=lambda t, x: jnp.asarray(G),
        diffusion_cov=V,
        step=STEP,
    )


def nonlinear(noise=0.3, **more):
    return nb.DiscreteSystem(
        transition=lambda k, x, w: (
            jnp.stack([x[0] + 0.1 * x[1], x[1] - 0.1 * jnp.sin(x[0])]) + (1 + 0.1 * x[0]) * w
        ),
        observe=lambda k, x, v: jnp.stack([jnp.sin(x[0]) + v[0], x[0] * x[1] / 4 + v[1]]),
        process_cov=0.01 * Q,
        measurement_cov=noise * np.eye(2),
        initial=START,
        **more,
    )


def noise_inside():
    """Noise enters both functions nonlinearly."""
    return nb.DiscreteSystem(
        transition=lambda k, x, w: x * jnp.exp(0.1 * w),
        observe=lambda k, x, v: x + v + 0.1 * v**2,
        process_cov=Q,
        measurement_cov=R,
        initial=START,
    )


def continuous_and_nonlinear():
    return nb.System(
        drift=lambda t, x: jnp.stack([x[1], -x[0] - 0.4 * x[1] * x[0] ** 2]),
        observe=lambda t, x: x[:1],
        measurement_cov=np.array([[0.3]]),
        initial=START,
        diffusion=lambda t, x: jnp.stack([jnp.zeros(1), 0.3 + 0.1 * x[:1]]),
        step=STEP,
    )


def cycle(f):
    def step(state, k, y):
        return f.update(f.predict(state, k, k + 1), k + 1, y)

    return step


@cache
def stepping(name):
    """A filter of the nonlinear system, its compiled cycle, and a list that grows with every trace of it."""
    f, traces = nb.filters.build(name, linear() if name == "kalman" else nonlinear()), []

    def step(state, k, y):
        traces.append(name)
        return cycle(f)(state, k, y)

    return f, jax.jit(step), traces


@pytest.mark.parametrize("name", EXACT)
def test_equals_the_kalman_filter_on_a_linear_system(name):
    """Against information-form updates in NumPy, and the log-likelihood of the innovations."""
    f = nb.filters.build(name, linear())
    step = jax.jit(cycle(f))
    state, (m, p) = f.init(START), START[:2]
    for k, y in enumerate(Y):
        state, info = step(state, k, y)
        m, p = A @ m + 0.1 * k, A @ p @ A.T + L @ Q @ L.T
        noise = D @ R @ D.T
        s, z = H @ p @ H.T + noise, y - H @ m
        m, p = kalman_update(m, p, H, noise, z)
        np.testing.assert_allclose(info.innovation, z, atol=1e-10)
        np.testing.assert_allclose(info.innovation_cov, s, atol=1e-10)
        density = -0.5 * (z @ np.linalg.solve(s, z) + np.log(np.linalg.det(2 * np.pi * s)))
        np.testing.assert_allclose(info.log_likelihood, density, atol=1e-10)
    np.testing.assert_allclose(f.moments(state).mean, m, atol=1e-10)
    np.testing.assert_allclose(f.moments(state).cov, p, atol=1e-10)


@pytest.mark.parametrize("name", EXACT)
def test_equals_the_kalman_filter_on_a_linear_system_in_continuous_time(name):
    """Those that integrate moments as RK4 does, the others as exactly as steps of a twentieth allow."""
    f = nb.filters.build(name, linear_in_continuous_time())
    state, (m, p) = f.init(START), START[:2]
    by_moments = dict(options_of(name)()).get("propagation", "moments") == "moments"
    Phi, noise = (np.asarray(each, float) for each in transition(F, G @ V @ G.T, INTERVAL))

    @jax.jit
    def step(state, t, y):
        return f.update(f.predict(state, t, t + INTERVAL), t + INTERVAL, y)[0]

    for k, y in enumerate(Y):
        t = k * INTERVAL
        state = step(state, t, y)
        if by_moments:
            steps = round(INTERVAL / STEP)
            m, p = kalman_predict_rk4(m, p, F, np.zeros(2), G @ V @ G.T, t, t + INTERVAL, steps)
        else:
            m, p = Phi @ m, Phi @ p @ Phi.T + noise
        m, p = kalman_update(m, p, H, R, y - H @ m)
    np.testing.assert_allclose(f.moments(state).mean, m, atol=1e-10 if by_moments else 1e-7)
    np.testing.assert_allclose(f.moments(state).cov, p, atol=1e-10 if by_moments else 1e-7)


def kalman_in_steps(Phi, noise, count, drive, R):
    m, p = START[:2]
    for k, y in enumerate(Y):
        for _ in range(count):
            m, p = Phi @ m + drive * k, Phi @ p @ Phi.T + noise
        m, p = kalman_update(m, p, H, R, y - H @ m)
    return m, p


@pytest.mark.parametrize("name", SAMPLING)
@pytest.mark.parametrize("kind", ["discrete", "continuous"])
def test_a_sample_has_the_kalman_moments_within_standard_errors(name, kind):
    """Over 24 independent samples; in continuous time against the filter's own steps: RK4, then Ito's noise."""
    repeats = 24
    if kind == "discrete":
        system, dt = linear(), 1
        m, p = kalman_in_steps(A, L @ Q @ L.T, 1, 0.1, D @ R @ D.T)
    else:
        system, dt = linear_in_continuous_time(), INTERVAL
        hF = STEP * F
        Phi = np.eye(2) + hF @ (np.eye(2) + hF @ (np.eye(2) / 2 + hF @ (np.eye(2) / 6 + hF / 24)))
        m, p = kalman_in_steps(Phi, STEP * G @ V @ G.T, round(INTERVAL / STEP), 0.0, R)
    f = nb.filters.build(name, system, **SAMPLING[name])

    @jax.jit
    @jax.vmap
    def run(key):
        state = f.init(START, key)

        def one(state, given):
            k, y = given
            state, _ = f.update(f.predict(state, k * dt, (k + 1) * dt), (k + 1) * dt, y)
            return state, None

        return f.moments(jax.lax.scan(one, state, (jnp.arange(len(Y)), jnp.asarray(Y)))[0])

    moments = run(jax.random.split(jax.random.key(3), repeats))
    for found, expected in ((moments.mean, m), (moments.cov, p)):
        error = np.asarray(found) - expected
        z = error.mean(0) / (error.std(0, ddof=1) / np.sqrt(repeats))
        assert np.abs(z).max() < 4.0
        assert np.abs(error).max() < 0.1


@EVERY
def test_a_measurement_without_information_changes_nothing(name):
    system = linear() if name == "kalman" else nonlinear(noise=1e26)
    f = nb.filters.build(name, system, **SAMPLING.get(name, {}))
    before = f.init(START)
    y = np.array([np.nan, np.nan]) if name == "kalman" else np.array([2.0, 1.0])
    after, _ = f.update(before, 0, y)
    np.testing.assert_allclose(f.moments(after).mean, f.moments(before).mean, atol=1e-11)
    np.testing.assert_allclose(f.moments(after).cov, f.moments(before).cov, atol=1e-11)


@EVERY
def test_measuring_nothing_is_prediction_only(name):
    f, step, _ = stepping(name)
    start = f.init(f.system.initial)
    state, info = step(start, 0, np.array([np.nan, np.nan]))
    ahead = jax.jit(lambda state: f.predict(state, 0, 1))(start)
    np.testing.assert_allclose(f.moments(state).mean, f.moments(ahead).mean, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(f.moments(state).cov, f.moments(ahead).cov, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(info.log_likelihood, 0.0, atol=1e-12)
    np.testing.assert_array_equal(info.innovation, [0.0, 0.0])


@pytest.mark.parametrize("name", EXACT)
def test_an_entry_that_is_missing_leaves_the_others_as_if_alone(name):
    """A system that has only the second measurement gives the same."""
    system = linear() if name == "kalman" else nonlinear()
    alone = nb.DiscreteSystem(
        system.transition,
        lambda k, x, v: system.observe(k, x, jnp.stack([jnp.zeros(()), v[0]]))[1:],
        system.process_cov,
        (np.eye(2) * system.measurement_cov)[1:, 1:],
        START,
    )
    both = nb.DiscreteSystem(
        system.transition, system.observe, system.process_cov, np.eye(2) * system.measurement_cov, START
    )
    found = []
    for which, y in ((both, [np.nan, 0.4]), (alone, [0.4])):
        f = nb.filters.build(name, which)
        state, info = jax.jit(lambda y, f=f: f.update(f.init(START), 0, y))(jnp.array(y))
        found.append((f.moments(state).mean, f.moments(state).cov, info.log_likelihood))
    for mine, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-11, atol=1e-12)


@EVERY
def test_a_loop_is_traced_once_and_moments_are_exactly_symmetric(name):
    f, step, traces = stepping(name)
    state = f.init(f.system.initial)
    for k in range(3):
        state, _ = step(state, jnp.asarray(k), jnp.array([0.3, 0.1]))
        cov = np.asarray(f.moments(state).cov)
        assert np.isfinite(cov).all()
        np.testing.assert_array_equal(cov, cov.T)
    traced = len(traces)
    step(state, jnp.asarray(3), jnp.array([0.3, np.nan]))
    assert len(traces) == traced


@EVERY
def test_vmap_equals_a_loop(name):
    f, _, _ = stepping(name)
    g = rng(2)
    starts = [f.init(nb.Moments(g.normal(size=2), 0.2 * random_cov(g, 2))) for _ in range(3)]
    y = jnp.asarray(g.normal(size=(3, 2)))
    assert_vmap_equals_a_loop(cycle(f), starts, jnp.asarray(0), y, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("name", [name for name in EXACT if name not in ("kalman", "bootstrap")])
def test_noise_inside_the_functions_is_taken_by_every_filter_with_moments(name):
    f = nb.filters.build(name, noise_inside())
    state, info = jax.jit(cycle(f))(f.init(START), 0, jnp.array([0.9, -0.4]))
    assert np.isfinite(f.moments(state).cov).all()
    assert np.isfinite(info.log_likelihood)
    assert np.all(np.diag(f.moments(state).cov) < np.diag(START.cov) * 2)


@pytest.mark.parametrize("name", [name for name in EXACT if name != "kalman"])
def test_rates_are_the_slope_of_predict_in_continuous_time(name):
    """(moments(h) - moments(0)) / h approaches rates as h -> 0, to first order in h."""
    system = continuous_and_nonlinear()
    f = nb.filters.build(name, system)
    state = f.init(system.initial)
    rates = jax.jit(lambda state: f.rates(state, 0.0))(state)
    start, gaps = f.moments(state), []
    for h in (1e-3, 5e-4):
        end = f.moments(jax.jit(lambda state, h=h: f.predict(state, 0.0, h))(state))
        slopes = ((end.mean - start.mean) / h, (end.cov - start.cov) / h)
        gaps.append(max(np.abs(slopes[0] - rates.mean).max(), np.abs(slopes[1] - rates.cov).max()))
    assert gaps[0] < 0.05
    assert gaps[1] < 0.55 * gaps[0]


def test_predicting_two_steps_is_predicting_twice():
    f = nb.filters.build("ghkf", nonlinear())
    state = f.init(START)
    once, twice = f.predict(state, 3, 5), f.predict(f.predict(state, 3, 4), 4, 5)
    np.testing.assert_allclose(once.mean, twice.mean, rtol=1e-13)
    np.testing.assert_allclose(f.predict(state, 3, 3).cov, state.cov)


@pytest.mark.parametrize("name", SAMPLING)
def test_a_key_decides_the_sample(name):
    """The same key gives the same numbers, another key others, of start, prediction and update alike."""
    f = nb.filters.build(name, nonlinear())
    one, other = jax.random.key(1), jax.random.key(2)

    def moved(start, key):
        state = f.predict(f.init(START, start), 0, 1, key)
        return np.asarray(f.moments(f.update(state, 1, np.array([0.3, 0.1]), key)[0]).mean)

    np.testing.assert_array_equal(moved(one, one), moved(one, one))
    assert not np.array_equal(moved(one, one), moved(other, one))
    assert not np.array_equal(moved(one, one), moved(one, other))


@pytest.mark.parametrize(
    ("name", "system", "says"),
    [
        ("kalman", nonlinear, "kalman: observe is not linear"),
        ("kalman", continuous_and_nonlinear, "kalman: drift is not linear"),
        ("bootstrap", noise_inside, "bootstrap: noise enters the measurement nonlinearly"),
    ],
)
def test_a_filter_that_does_not_apply_says_so(name, system, says):
    with pytest.raises(ConfigError, match=says):
        nb.filters.build(name, system())


@pytest.mark.parametrize("name", ["ekf", "ukf", "gaussian-sum", "ensemble", "bootstrap"])
def test_rates_are_refused_where_there_are_none(name):
    f = nb.filters.build(name, nonlinear())
    with pytest.raises(ConfigError, match=f"{name}: .* no time derivatives"):
        f.rates(f.init(START), 0)


def test_wrong_shapes_are_named():
    system = nb.DiscreteSystem(
        lambda k, x, w: x[:1] + w[:1], lambda k, x, v: x[0] + v[0], np.eye(2), np.eye(1), START
    )
    with pytest.raises(ConfigError, match="transition") as caught:
        nb.filters.build("ekf", system)
    assert "expected (2,)" in str(caught.value)
    assert "observe" in str(caught.value)
