"""Claim: the point-mass grid is Bayes's rule for one or two states in discrete time, and says where it is not."""

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
from nlbench.references.dependence import depends
from nlbench.systems.exact import PointMass

GROWTH = nb.systems.build("ungm")
GRID = PointMass((-40.0,), (40.0,), (2401,))
Y = np.array([[3.0], [np.nan], [8.0], [1.0], [12.0]])


def build(system, record):
    return nb.filters.build("exact", replace(system, exact=record))


def linear(A, G, H, Q, R, mean, cov, **more):
    return nb.DiscreteSystem(
        transition=lambda k, x, w: jnp.asarray(A) @ x + jnp.asarray(G) @ w,
        observe=lambda k, x, v: jnp.asarray(H) @ x + v,
        process_cov=Q,
        measurement_cov=R,
        initial=nb.Moments(mean, cov),
        **more,
    )


SCALAR = linear([[0.9]], [[0.8]], [[1.3]], [[0.7]], [[0.5]], [0.4], [[1.2]])
SCALAR_GRID = PointMass((-9.0,), (9.0,), (121,))
PLANE = linear(
    [[0.8, 0.3], [-0.2, 0.7]],
    [[1.0, 0.2], [0.0, 0.9]],
    [[1.0, 0.5], [0.0, 1.0]],
    [[0.6, 0.1], [0.1, 0.5]],
    [[0.8, 0.2], [0.2, 1.1]],
    [0.3, -0.2],
    [[1.0, 0.3], [0.3, 0.8]],
)
PLANE_GRID = PointMass((-8.0, -8.5), (8.0, 8.5), (36, 36))
PLANE_Y = np.array([[0.5, -1.0], [1.5, np.nan], [np.nan, np.nan], [-0.8, 0.3]])


def run(f, y):
    """Moments and info after each measurement."""
    step = jax.jit(lambda state, k, y: f.update(f.integrate(state, k, 1, 1), k + 1, y))
    state = f.init(f.system.initial)
    for k, value in enumerate(y):
        state, info = step(state, k, value)
        yield f.moments(state), info


def kalman(system, A, G, H, y):
    """Means, covariances and log-likelihoods, entries that are NaN left out."""
    A, G, H = (np.asarray(part) for part in (A, G, H))
    m, P = np.asarray(system.initial.mean), np.asarray(system.initial.cov)
    for value in y:
        m, P = A @ m, A @ P @ A.T + G @ np.asarray(system.process_cov) @ G.T
        taken, level = ~np.isnan(value), 0.0
        if taken.any():
            C, R = H[taken], np.asarray(system.measurement_cov)[np.ix_(taken, taken)]
            S = C @ P @ C.T + R
            level = multivariate_normal(C @ m, S).logpdf(value[taken])
            K = P @ C.T @ np.linalg.inv(S)
            m, P = m + K @ (value[taken] - C @ m), P - K @ C @ P
        yield m, P, level


@pytest.mark.parametrize(
    ("system", "record", "matrices", "y"),
    [
        (SCALAR, SCALAR_GRID, ([[0.9]], [[0.8]], [[1.3]]), np.array([[1.0], [np.nan], [-0.7], [2.5]])),
        (
            PLANE,
            PLANE_GRID,
            ([[0.8, 0.3], [-0.2, 0.7]], [[1.0, 0.2], [0.0, 0.9]], [[1.0, 0.5], [0.0, 1.0]]),
            PLANE_Y,
        ),
    ],
    ids=["one state", "two states"],
)
def test_equals_the_kalman_filter_on_a_linear_system(system, record, matrices, y):
    """Even sums over Gaussians at least as wide as the spacing err by 2 exp(-2 pi^2), 5e-9, and less."""
    found = run(build(system, record), y)
    for (moments, info), (m, P, level) in zip(found, kalman(system, *matrices, y), strict=True):
        np.testing.assert_allclose(moments.mean, m, atol=1e-8)
        np.testing.assert_allclose(moments.cov, P, atol=1e-8)
        np.testing.assert_allclose(moments.third, 0.0, atol=1e-7)
        gaussian = sum(
            np.einsum(f"{pair},{rest}->ijkl", P, P)
            for pair, rest in (("ij", "kl"), ("ik", "jl"), ("il", "jk"))
        )
        np.testing.assert_allclose(moments.fourth, gaussian, atol=1e-7)
        np.testing.assert_allclose(info.log_likelihood, level, atol=1e-8)


def growth_by_quadrature(y, nodes=4000):
    """Mean, variance, third moment and log-likelihood of the growth model: densities at Gauss-Legendre nodes."""
    x, c = np.polynomial.legendre.leggauss(nodes)
    x, c = 36 * x, 36 * c
    p = norm(0.1, 1.0).pdf(x)
    for k, value in enumerate(y[:, 0]):
        there = x / 2 + 25 * x / (1 + x**2) + 8 * np.cos(1.2 * k)
        p = np.exp(-0.5 * (x[:, None] - there) ** 2) @ (c * p) / np.sqrt(2 * np.pi)
        level = 0.0
        if not np.isnan(value):
            p = p * norm.pdf(value - x**2 / 20)
            level = np.log(np.sum(c * p))
            p = p / np.sum(c * p)
        mean = np.sum(c * p * x)
        yield mean, np.sum(c * p * (x - mean) ** 2), np.sum(c * p * (x - mean) ** 3), level


@pytest.mark.long
def test_the_growth_model_is_quadrature_at_other_points():
    found = run(build(GROWTH, GRID), Y)
    for (moments, info), (mean, variance, third, level) in zip(found, growth_by_quadrature(Y), strict=True):
        np.testing.assert_allclose(moments.mean[0], mean, atol=1e-9)
        np.testing.assert_allclose(moments.cov[0, 0], variance, rtol=1e-9)
        np.testing.assert_allclose(moments.third[0, 0, 0], third, atol=1e-8 * variance**1.5)
        np.testing.assert_allclose(info.log_likelihood, level, atol=1e-10)


def noisy(**more):
    """A disturbance and a measurement noise that grow with the state."""
    return nb.DiscreteSystem(
        transition=lambda k, x, w: 0.5 * x + jnp.sqrt(1.0 + 0.3 * x**2) * w,
        observe=lambda k, x, v: jnp.sin(x) + (1.0 + x**2 / 4) * v,
        process_cov=[[0.5]],
        measurement_cov=[[0.4]],
        initial=nb.Moments([0.2], [[0.6]]),
        **more,
    )


def test_noise_may_grow_with_the_state_in_transition_and_measurement():
    y = 1.4
    ((moments, info),) = run(build(noisy(), PointMass((-24.0,), (24.0,), (961,))), [np.array([y])])

    x, c = np.polynomial.legendre.leggauss(400)
    start, to = 7 * x, 24 * x
    joint = norm(0.5 * start, np.sqrt(0.5 * (1 + 0.3 * start**2))).pdf(to[:, None])
    joint = joint @ (7 * c * norm(0.2, np.sqrt(0.6)).pdf(start))
    joint = 24 * c * joint * norm(np.sin(to), np.sqrt(0.4) * (1 + to**2 / 4)).pdf(y)
    evidence, first, second = (joint @ to**power for power in range(3))
    np.testing.assert_allclose(info.log_likelihood, np.log(evidence), atol=1e-7)
    np.testing.assert_allclose(moments.mean[0], first / evidence, atol=1e-7)
    np.testing.assert_allclose(moments.cov[0, 0], second / evidence - (first / evidence) ** 2, atol=1e-7)


def test_what_is_foretold_of_a_measurement_is_its_mean_and_covariance():
    f = build(SCALAR, SCALAR_GRID)
    state = f.init(SCALAR.initial)
    _, info = f.update(state, 0, jnp.array([1.0]))
    np.testing.assert_allclose(info.innovation, [1.0 - 1.3 * 0.4], atol=1e-8)
    np.testing.assert_allclose(info.innovation_cov, [[1.3**2 * 1.2 + 0.5]], atol=1e-8)


def test_residuals_are_wrapped_as_the_system_says():
    wrap = lambda y, h: jnp.mod(y - h + jnp.pi, 2 * jnp.pi) - jnp.pi  # noqa: E731
    f = build(replace(SCALAR, residual=wrap), SCALAR_GRID)
    state = f.init(SCALAR.initial)
    for turned, plain in zip(
        *(f.update(state, 0, jnp.array([y])) for y in (0.3 + 2 * np.pi, 0.3)), strict=True
    ):
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, atol=1e-12), turned, plain)


def test_a_missing_measurement_changes_nothing():
    f = build(SCALAR, SCALAR_GRID)
    state = f.integrate(f.init(SCALAR.initial), 0, 1, 1)
    after, info = f.update(state, 1, jnp.array([jnp.nan]))
    np.testing.assert_array_equal(after.weights, state.weights)
    assert float(info.log_likelihood) == 0.0
    assert float(info.innovation[0]) == 0.0


def test_a_kernel_that_stays_is_formed_once_and_another_at_every_step():
    lasting = lambda k, x, w: 0.9 * x + w  # noqa: E731
    changing = lambda k, x, w: 0.9 * x + jnp.cos(0.0 * k) - 1 + w  # noqa: E731
    x = jnp.ones(1)
    assert not depends(lambda k: lasting(k, x, x), 0)
    assert depends(lambda k: changing(k, x, x), 0)
    y = np.array([[1.0], [2.0]])
    one, other = (
        run(build(replace(SCALAR, transition=each), SCALAR_GRID), y) for each in (lasting, changing)
    )
    for (mine, _), (theirs, _) in zip(one, other, strict=True):
        np.testing.assert_allclose(mine.fourth, theirs.fourth, rtol=1e-12)


def test_a_block_is_its_trajectories_one_by_one():
    f = build(GROWTH, PointMass((-40.0,), (40.0,), (161,)))
    y = jnp.array([[3.0, -1.0, jnp.nan]])
    start = f.init(GROWTH.initial)

    @jax.jit
    def cycle(state, y):
        return f.update(f.integrate(state, 3, 1, 1), 4, y)[0].weights

    block = over_lanes(lambda weights, y: cycle(start._replace(weights=weights), y))
    lanes = block(jnp.broadcast_to(start.weights[:, None], (161, 3)), y)
    for lane in range(3):
        np.testing.assert_allclose(lanes[:, lane], cycle(start, y[:, lane]), rtol=1e-9, atol=1e-15)


def test_probability_that_leaves_the_grid_makes_everything_not_a_number():
    """A random walk on +-9 has lost a ten-thousandth of its probability after some steps, not after the first."""
    walk = linear([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], [0.0], [[1.0]])
    f = build(walk, PointMass((-9.0,), (9.0,), (91,)))
    state = f.integrate(f.init(walk.initial), 0, 1, 1)
    np.testing.assert_allclose(f.moments(state).cov, [[2.0]], rtol=1e-7)
    state = f.integrate(state, 1, 1, 60)
    assert np.isnan(f.moments(state).mean).all()
    _, info = f.update(state, 61, jnp.zeros(1))
    assert np.isnan(info.log_likelihood)


def test_a_start_that_the_grid_does_not_hold_is_not_a_number():
    f = build(SCALAR, SCALAR_GRID)
    assert np.isnan(f.moments(f.init(nb.Moments([8.0], [[1.0]]))).mean).all()


def test_a_posterior_in_a_single_cell_is_not_a_number():
    sharp = replace(SCALAR, measurement_cov=[[1e-6]])
    f = build(sharp, SCALAR_GRID)
    state, _ = f.update(f.init(sharp.initial), 0, jnp.array([1.3 * SCALAR_GRID.upper[0] / 6]))
    assert np.isnan(f.moments(state).mean).all()


THREE = linear(np.eye(3), np.eye(3), np.eye(3), np.eye(3), np.eye(3), np.zeros(3), np.eye(3))
REFUSED = {
    "one or two states": (THREE, PointMass((-5.0,) * 3, (5.0,) * 3, (9,) * 3)),
    "need 1 entries": (SCALAR, PLANE_GRID),
    "at most 8,192": (PLANE, PointMass((-8.0, -8.0), (8.0, 8.0), (100, 100))),
    "enters the transition nonlinearly": (
        replace(SCALAR, transition=lambda k, x, w: x + w + w**2),
        SCALAR_GRID,
    ),
    "enters the measurement nonlinearly": (
        replace(SCALAR, observe=lambda k, x, v: x * jnp.exp(v)),
        SCALAR_GRID,
    ),
    "the noise of the transition has a standard deviation of 0 ": (
        replace(PLANE, transition=lambda k, x, w: jnp.stack([x[0] + w[0], x[1]])),
        PLANE_GRID,
    ),
    "the noise of the transition has a standard deviation of 0.59": (
        SCALAR,
        PointMass((-9.0,), (9.0,), (17,)),
    ),
    "the prior has a standard deviation": (replace(SCALAR, initial=nb.Moments([0.0], [[1e-4]])), SCALAR_GRID),
}


@pytest.mark.parametrize("message", REFUSED)
def test_refuses_what_it_is_not_for(message):
    with pytest.raises(ConfigError, match=message):
        build(*REFUSED[message])


def test_refuses_continuous_time():
    with pytest.raises(ConfigError, match="is for discrete time"):
        build(nb.systems.build("culver-scalar"), SCALAR_GRID)


def test_has_no_time_derivatives():
    f = build(SCALAR, SCALAR_GRID)
    with pytest.raises(ConfigError, match="time is discrete"):
        f.rates(f.init(SCALAR.initial), 0)
