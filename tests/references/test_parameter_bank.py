"""Claim: the bank is Bayes's rule for a linear system in discrete time with one unknown constant."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

import nlbench as nb
from nlbench.engine.follow import over_lanes
from nlbench.errors import ConfigError
from nlbench.systems.exact import ParameterBank

COEFFICIENT = norm(0.5, 0.23)
NODES, SHARES = np.polynomial.legendre.leggauss(60)
NODES = 0.5 + 0.23 * 8 * NODES
WEIGHTS = SHARES * COEFFICIENT.pdf(NODES)
WEIGHTS = WEIGHTS / WEIGHTS.sum()

SCALAR = nb.systems.build("parameter-identification")
RECORD = ParameterBank(NODES, WEIGHTS, [0.0], [[4 / 3]])
Y = np.array([[1.5], [np.nan], [-2.0], [0.7], [2.9]])

# Two states and a constant in both the transition and the measurement; an offset that depends on the step.
PAIR = nb.DiscreteSystem(
    transition=lambda k, x, w: jnp.stack(
        [x[0] + 0.3 * x[1] + 0.5 * w[0], x[2] * x[1] + 0.2 * jnp.cos(1.0 * k) + w[0] - w[1], x[2]]
    ),
    observe=lambda k, x, v: jnp.stack([x[0] * (1 + x[2]) + v[0], x[0] - x[1] + x[2] + 2 * v[1] + v[0]]),
    process_cov=[[0.3, 0.1], [0.1, 0.4]],
    measurement_cov=[[0.5, 0.1], [0.1, 0.2]],
    initial=nb.Moments([1.0, -0.5, 0.5], [[0.8, 0.2, 0], [0.2, 0.6, 0], [0, 0, 0.23**2]]),
)
PAIR_RECORD = ParameterBank(NODES, WEIGHTS, [1.0, -0.5], [[0.8, 0.2], [0.2, 0.6]])
PAIR_Y = np.array([[1.0, 2.0], [np.nan, 0.3], [0.2, -1.0]])


def scalar_matrices(a, k):
    """A, offset, G, C, c, D."""
    return np.array([[a]]), [0.0], np.eye(1), np.eye(1), [0.0], np.eye(1)


def pair_matrices(a, k):
    A, G = np.array([[1, 0.3], [0, a]]), np.array([[0.5, 0], [1, -1]])
    C, D = np.array([[1 + a, 0], [1, -1]]), np.array([[1, 0], [1, 2]])
    return A, [0.0, 0.2 * np.cos(k)], G, C, [0.0, a], D


CASES = {"scalar": (SCALAR, RECORD, scalar_matrices, Y), "pair": (PAIR, PAIR_RECORD, pair_matrices, PAIR_Y)}


def conditional(record, system, matrices, a, y):
    """Mean and covariance of the last x given y and the constant, and the density of y: of the whole path at once."""
    k = len(record.mean)
    mean, cov = np.asarray(record.mean, float), np.asarray(record.cov, float)
    states, rows, noises, means = np.eye(k), [], [], []
    sources = [cov]
    for step, _ in enumerate(y):
        A, offset, G, C, c, D = matrices(a, step)
        mean = A @ mean + offset
        states = np.hstack([A @ states, G])
        sources.append(np.asarray(system.process_cov))
        rows.append(C @ states)
        means.append(C @ mean + c)
        noises.append(D @ np.asarray(system.measurement_cov) @ D.T)
    width = states.shape[1]
    spread = np.zeros((width, width))
    at = 0
    for each in sources:
        spread[at : at + len(each), at : at + len(each)] = each
        at += len(each)
    H = np.vstack([np.pad(row, ((0, 0), (0, width - row.shape[1]))) for row in rows])
    R = np.kron(np.eye(len(y)), noises[0])
    taken = ~np.isnan(y.ravel())
    z = (y.ravel() - np.concatenate(means))[taken]
    S = (H @ spread @ H.T + R)[np.ix_(taken, taken)]
    gain = np.linalg.solve(S, (H @ spread @ states.T)[taken]).T
    own = states @ spread @ states.T - gain @ (H @ spread @ states.T)[taken]
    return mean + gain @ z, own, multivariate_normal(np.zeros(len(z)), S).pdf(z)


def posterior(record, system, matrices, y, points=1501):
    """Moments 1 to 4 of (x, constant), and the density of y, by even sums over the constant."""
    nodes = np.linspace(0.5 - 0.23 * 8, 0.5 + 0.23 * 8, points)
    each = [conditional(record, system, matrices, node, y) for node in nodes]
    means = np.column_stack([np.array([m for m, _, _ in each]), nodes])
    P = np.zeros((points, *(means.shape[1],) * 2))
    P[:, :-1, :-1] = [P for _, P, _ in each]
    w = COEFFICIENT.pdf(nodes) * np.array([density for _, _, density in each]) * (nodes[1] - nodes[0])
    evidence, w = w.sum(), w / w.sum()
    mean = w @ means
    d, sums = means - mean, np.einsum
    cov = sums("p,pi,pj->ij", w, d, d) + sums("p,pij->ij", w, P)
    third = sums("p,pi,pj,pk->ijk", w, d, d, d)
    third += sum(
        sums(f"p,p{pair},p{one}->ijk", w, P, d) for pair, one in (("ij", "k"), ("ik", "j"), ("jk", "i"))
    )
    fourth = sums("p,pi,pj,pk,pl->ijkl", w, d, d, d, d)
    for one, two in (("ij", "kl"), ("ik", "jl"), ("il", "jk")):
        fourth += sums(f"p,p{one},p{two}->ijkl", w, P, P)
        for near, far in ((one, two), (two, one)):
            fourth += sums(f"p,p{near},p{far[0]},p{far[1]}->ijkl", w, P, d, d)
    return mean, cov, third, fourth, evidence


def build(system, record):
    return nb.filters.build("exact", replace(system, exact=record))


@pytest.mark.parametrize("name", CASES)
def test_posterior_is_a_sum_over_the_constant_of_what_the_whole_path_says(name):
    system, record, matrices, y = CASES[name]
    f = build(system, record)
    step = jax.jit(lambda state, k, y: f.update(f.integrate(state, k, 1, 1), k + 1, y))
    state, total = f.init(system.initial), 0.0
    for k, value in enumerate(y):
        state, info = step(state, k, value)
        total += info.log_likelihood
    *moments, evidence = posterior(record, system, matrices, y)
    for mine, theirs in zip(f.moments(state), moments, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(total, np.log(evidence), atol=1e-9)


def test_several_steps_are_as_many_single_ones():
    f = build(PAIR, PAIR_RECORD)
    state = f.init(PAIR.initial)
    once = f.predict(f.predict(state, 0, 1), 1, 3)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-12), f.predict(state, 0, 3), once)


def test_a_missing_measurement_changes_nothing():
    f = build(PAIR, PAIR_RECORD)
    state = f.init(PAIR.initial)
    after, info = f.update(state, 0, jnp.array([jnp.nan, jnp.nan]))
    jax.tree.map(np.testing.assert_array_equal, f.moments(after), f.moments(state))
    assert float(info.log_likelihood) == 0.0


def test_a_block_is_its_trajectories_one_by_one():
    f = build(SCALAR, RECORD)
    start, y = f.init(SCALAR.initial), jnp.array([[1.0, -2.0, jnp.nan]])

    @jax.jit
    def cycle(state, y):
        return f.moments(f.update(f.integrate(state, 0, 1, 1), 1, y)[0]).third

    begun = jax.tree.map(lambda leaf: jnp.broadcast_to(leaf[..., None], (*leaf.shape, 3)), start)
    lanes = over_lanes(cycle)(begun, y)
    for lane in range(3):
        np.testing.assert_allclose(lanes[..., lane], cycle(start, y[:, lane]), rtol=1e-12, atol=1e-14)


REFUSED = {
    "is for discrete time": nb.systems.build("oscillator"),
    "transition is not linear": replace(
        SCALAR, transition=lambda k, x, w: jnp.stack([x[0] ** 2 + w[0], x[1]])
    ),
    "observe is not linear": replace(SCALAR, observe=lambda k, x, v: jnp.sin(x[:1]) + v),
    "the last state is not constant": replace(
        SCALAR, transition=lambda k, x, w: jnp.stack([x[0] * x[1] + w[0], 0.9 * x[1]])
    ),
    "noise of a measurement depends": replace(SCALAR, observe=lambda k, x, v: x[:1] + x[1] * v),
}


@pytest.mark.parametrize("message", REFUSED)
def test_refuses_what_it_is_not_for(message):
    with pytest.raises(ConfigError, match=message):
        build(REFUSED[message], RECORD)
