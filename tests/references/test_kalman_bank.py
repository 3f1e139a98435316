"""Claim: the bank of Kalman filters is Bayes's rule for the oscillator, process noise included, and is calibrated."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad_vec, simpson
from scipy.linalg import block_diag, expm
from scipy.stats import truncnorm

import nlbench as nb
from nlbench.engine.follow import over_lanes

BOUND = 0.84 / 0.5003729518
DAMPING = truncnorm(-BOUND, BOUND, loc=0.5, scale=0.5003729518)
START, COV = np.array([10.0, 0.0]), 9.0 * np.eye(2)
TIMES = (0.3, 0.6, 1.5)
Y = np.array([[9.0, -1.0], [6.5, np.nan], [0.3, -6.0]])
R = 4.0


def build(**parameters):
    system = nb.systems.build("oscillator", measurement_variance=R, **parameters)
    return system, nb.filters.build("exact", system)


def motion(damping):
    return np.array([[0.0, 1.0], [-1.0, -2.0 * damping]])


def joint(damping, times, spectrum):
    """Mean and covariance of (x(t1), ..., x(tK)) given the damping ratio: of the whole path at once, no recursion."""
    A, B = motion(damping), np.diag([0.0, spectrum])
    Phi = [expm(A * t) for t in times]
    spread = [
        quad_vec(lambda s: expm(A * s) @ B @ expm(A * s).T, 0, t, epsabs=1e-12)[0] if spectrum else 0 * COV
        for t in times
    ]
    cov = np.empty((len(times), 2, len(times), 2))
    for k in range(len(times)):
        own = Phi[k] @ COV @ Phi[k].T + spread[k]
        for late in range(k, len(times)):
            cov[late, :, k] = expm(A * (times[late] - times[k])) @ own
            cov[k, :, late] = cov[late, :, k].T
    return np.concatenate([each @ START for each in Phi]), cov.reshape(2 * len(times), -1)


def conditional(damping, times, y, spectrum):
    """Mean and covariance of the last x given y and the damping ratio, and the density of y."""
    mean, cov = joint(damping, times, spectrum)
    taken = ~np.isnan(y.ravel())
    S = (cov + R * np.eye(len(mean)))[np.ix_(taken, taken)]
    z = (y.ravel() - mean)[taken]
    gain = np.linalg.solve(S, cov[taken][:, -2:]).T
    density = np.exp(-0.5 * z @ np.linalg.solve(S, z)) / np.sqrt(np.linalg.det(2 * np.pi * S))
    return mean[-2:] + gain @ z, cov[-2:, -2:] - gain @ cov[taken][:, -2:], density


def posterior(times, y, spectrum, points=401):
    """Moments 1 to 4 of (x, damping) given y by Simpson's rule over the damping ratio, and the evidence."""
    nodes = np.linspace(*DAMPING.support(), points)
    each = [conditional(node, times, y, spectrum) for node in nodes]
    means = np.column_stack([np.array([m for m, _, _ in each]), nodes])
    P = np.array([block_diag(P, [[0.0]]) for _, P, _ in each])
    weights = DAMPING.pdf(nodes) * np.array([density for _, _, density in each])
    evidence = simpson(weights, x=nodes)

    def expectation(values):
        return simpson((weights * values.T).T, x=nodes, axis=0) / evidence

    mean = expectation(means)
    d = means - mean
    outer = np.einsum
    cov = expectation(outer("pi,pj->pij", d, d) + P)
    third = outer("pi,pj,pk->pijk", d, d, d)
    third += outer("pij,pk->pijk", P, d) + outer("pik,pj->pijk", P, d) + outer("pjk,pi->pijk", P, d)
    fourth = outer("pi,pj,pk,pl->pijkl", d, d, d, d)
    for pairs in ("ij,kl", "ik,jl", "il,jk"):
        one, two = pairs.split(",")
        fourth += outer(f"p{one},p{two}->pijkl", P, P)
        for near, far in ((one, two), (two, one)):
            fourth += outer(f"p{near},p{far[0]},p{far[1]}->pijkl", P, d, d)
    return mean, cov, expectation(third), expectation(fourth), evidence


def run(f, initial, times, y):
    """The state after the last update, and the sum of the log-likelihoods."""
    state, previous, total = f.init(initial), 0.0, 0.0
    for t, value in zip(times, y, strict=True):
        state, info = f.update(f.predict(state, previous, t), t, jnp.asarray(value))
        previous, total = t, total + float(info.log_likelihood)
    return state, total


@pytest.mark.parametrize("spectrum", [0.0, pytest.param(10.0, marks=pytest.mark.long)])
@pytest.mark.parametrize("count", [1, 3])
def test_posterior_is_bayes_rule_over_the_damping_ratio(spectrum, count):
    """Against whole-path Gaussian conditioning at 401 points and Simpson's rule, one entry missing: rel. 1e-7."""
    system, f = build(process_variance=spectrum)
    state, level = run(f, system.initial, TIMES[:count], Y[:count])
    *expected, evidence = posterior(TIMES[:count], Y[:count], spectrum)
    for mine, theirs in zip(f.moments(state), expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7, atol=1e-7 * np.abs(theirs).max())
    np.testing.assert_allclose(level, np.log(evidence), rtol=1e-8)


@pytest.mark.parametrize("spectrum", [0.0, 1.0])
def test_one_long_interval_is_many_short_ones_and_the_same_when_compiled(spectrum):
    system, f = build(process_variance=spectrum)
    start, _ = run(f, system.initial, TIMES[:1], Y[:1])
    long, short = f.predict(start, 0.3, 1.3), start
    for k in range(5):
        short = f.predict(short, 0.3 + 0.2 * k, 0.5 + 0.2 * k)
    compiled = jax.jit(f.predict)(start, jnp.asarray(0.3), jnp.asarray(1.3))
    for mine, other, third in zip(f.moments(long), f.moments(short), f.moments(compiled), strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-11 * np.abs(mine).max())
        np.testing.assert_allclose(mine, third, atol=1e-11 * np.abs(mine).max())


@pytest.mark.parametrize("spectrum", [0.0, 1.0])
def test_rates_are_the_slope_of_the_moments(spectrum):
    system, f = build(process_variance=spectrum)
    state, _ = run(f, system.initial, TIMES[:1], Y[:1])
    rates, h = f.rates(state, 0.3), 1e-4
    before, after = (f.moments(f.predict(state, 0.0, step)) for step in (-h, h))
    for rate, low, high in zip(rates, before, after, strict=True):
        np.testing.assert_allclose(rate, (high - low) / (2 * h), atol=1e-6 * np.abs(rate).max())


def test_a_missing_measurement_changes_nothing():
    system, f = build()
    state, _ = run(f, system.initial, TIMES[:1], Y[:1])
    after, info = f.update(state, 0.3, jnp.full(2, jnp.nan))
    for mine, theirs in zip(f.moments(after), f.moments(state), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-14, atol=1e-14)
    assert float(info.log_likelihood) == 0.0
    np.testing.assert_array_equal(info.innovation, [0.0, 0.0])


def test_innovation_has_the_mean_and_covariance_of_the_foretold_measurement():
    system, f = build()
    state, _ = run(f, system.initial, TIMES[:1], Y[:1])
    state = f.predict(state, 0.3, 0.6)
    moments = f.moments(state)
    _, info = f.update(state, 0.6, jnp.asarray([6.5, 1.0]))
    np.testing.assert_allclose(info.innovation, np.array([6.5, 1.0]) - moments.mean[:2], rtol=1e-12)
    np.testing.assert_allclose(info.innovation_cov, moments.cov[:2, :2] + R * np.eye(2), rtol=1e-12)


@pytest.mark.parametrize("spectrum", [0.0, 1.0])
def test_lanes_are_the_trajectories_one_by_one(spectrum):
    """As the engine calls it, with the lanes last."""
    system, f = build(process_variance=spectrum)
    y = np.random.default_rng(2).normal([[9.0], [-2.0]], 2.0, size=(2, 3))

    def cycle(state, value):
        return f.update(f.integrate(state, 0.0, 0.05, 4), 0.2, value)[0]

    start = f.init(system.initial)
    lanes = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[..., None], (*leaf.shape, 3)), start)
    components = jax.jit(
        lambda states, y: over_lanes(lambda state, value: f.components(cycle(state, value)))(states, y)
    )
    together = components(lanes, jnp.asarray(y))
    for lane in range(3):
        alone = f.components(cycle(start, jnp.asarray(y[:, lane])))
        for mine, theirs in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(mine[lane], theirs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("spectrum", [0.0, pytest.param(10.0, marks=pytest.mark.long)])
def test_estimated_moments_are_the_actual_ones(spectrum):
    """Over 2,000 runs, errors and their products less the estimated moments average to zero, |z| < 4."""
    system, f = build(process_variance=spectrum)
    runs, count, interval = 2000, 8, 0.5
    g = np.random.default_rng(5)
    damping = DAMPING.rvs(runs, random_state=g)
    paths = [joint(each, interval * np.arange(1, count + 1), spectrum) for each in damping[: runs // 10]]
    # each path's law serves ten runs, whose noises are independent
    laws = [(mean, np.linalg.cholesky(cov + 1e-9 * np.eye(len(mean)))) for mean, cov in paths]
    damping = np.repeat(damping[: runs // 10], 10)
    x = np.array([m + root @ g.normal(size=len(m)) for m, root in laws for _ in range(10)])
    x = x.reshape(runs, count, 2)
    y = x + np.sqrt(R) * g.normal(size=x.shape)

    def estimate(y):
        def step(state, value):
            return f.update(f.integrate(state, 0.0, interval, 1), 0.0, value)[0], None

        return f.moments(jax.lax.scan(step, f.init(system.initial), y)[0])

    moments = jax.jit(lambda y: jax.lax.map(estimate, y, batch_size=100))(y)
    mean, cov, third = (np.asarray(part) for part in moments[:3])
    e = np.column_stack([x[:, -1], damping]) - mean
    products = {
        "mean": e,
        "cov": np.einsum("ri,rj->rij", e, e) - cov,
        "third": np.einsum("ri,rj,rk->rijk", e, e, e) - third,
    }
    for name, values in products.items():
        groups = values.reshape(runs // 10, 10, -1).mean(1)  # runs of one damping ratio are not independent
        z = groups.mean(0) / (groups.std(0) / np.sqrt(len(groups)))
        assert np.abs(z).max() < 4, (name, z)
    assert np.std(e[:, 2]) < 0.75 * np.std(damping), "the measurements must have told something"
