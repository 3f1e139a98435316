"""Claim: for a linear measurement the Hermite updates are Bayes' rule, checked by quadrature."""

from __future__ import annotations

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle import Posterior, bayes, fourth_moment, kalman_update, random_cov, rng, symmetrise
from tests.problems import dense, linear_measurement, updated

SHAPES = [(1, 1), (1, 2), (2, 1), (2, 2)]


class Case:
    """A random Hermite prior and a linear measurement of it; `size` scales the third and fourth cumulants."""

    def __init__(self, seed, n, r, size=0.25):
        g = rng((seed, n, r))
        self.mean, self.cov = g.normal(size=n), random_cov(g, n)
        root = np.linalg.cholesky(self.cov)
        third, k4 = size * symmetrise(g.normal(size=(n,) * 3)), size * symmetrise(g.normal(size=(n,) * 4))
        self.third = np.einsum("abc,ia,jb,kc->ijk", third, root, root, root)
        self.k4 = np.einsum("abcd,ia,jb,kc,ld->ijkl", k4, root, root, root, root)
        self.h, self.noise = g.normal(size=(r, n)), random_cov(g, r)
        predicted = self.h @ self.cov @ self.h.T + self.noise
        self.z = np.linalg.cholesky(predicted) @ g.normal(size=r)

    @property
    def y(self):
        return self.h @ self.mean + self.z

    def system(self, fourth=None):
        return linear_measurement(self.mean, self.cov, self.h, self.noise, self.third, fourth)

    def bayes(self, order) -> Posterior:
        third, k4 = self.third if order >= 3 else None, self.k4 if order >= 4 else None
        return bayes(self.mean, self.cov, third, k4, lambda x: self.h @ x, self.noise, self.y)


@cache
def case_and_bayes(seed, n, r, order):
    case = Case(seed, n, r)
    return case, case.bayes(order)


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=1e-9, atol=1e-9 * max(1e-3, np.abs(expected).max()))


@pytest.mark.parametrize(("n", "r"), SHAPES)
@pytest.mark.parametrize("seed", range(2))
def test_third_order_posterior_is_bayes(seed, n, r):
    case, exact = case_and_bayes(seed, n, r, 3)
    moments, info = updated("third-order", case.system(), case.y)
    mean, cov, third, _ = dense(moments)
    assert_close(mean, exact.mean)
    assert_close(cov, exact.cov)
    assert_close(third, exact.third)
    assert_close(info.log_likelihood, np.log(exact.evidence))


@pytest.mark.parametrize(("n", "r"), SHAPES)
@pytest.mark.parametrize("seed", range(2))
def test_fourth_order_posterior_is_bayes(seed, n, r):
    case, exact = case_and_bayes(seed, n, r, 4)
    moments, info = updated("fourth-order", case.system(fourth_moment(case.cov, case.k4)), case.y)
    for mine, theirs in zip(dense(moments), exact[:4], strict=True):
        assert_close(mine, theirs)
    assert_close(info.log_likelihood, np.log(exact.evidence))


@pytest.mark.parametrize(("n", "r"), SHAPES)
def test_nu_is_the_evidence_over_that_of_a_gaussian(n, r):
    """(1 + nu) N(z; 0, Sz) is the predictive density of the Hermite prior."""
    for order, name in ((3, "third-order"), (4, "fourth-order")):
        case, exact = case_and_bayes(0, n, r, order)
        fourth = fourth_moment(case.cov, case.k4) if order == 4 else None
        _, info = updated(name, case.system(fourth), case.y)
        assert_close(1 + info.nu, exact.evidence / case.bayes(2).evidence)


@pytest.mark.parametrize(("n", "r"), SHAPES)
def test_suboptimal_updates_keep_part_of_the_optimal_one(n, r):
    """Sub1: Kalman mean and covariance (5.67). Sub2: optimal mean, Kalman covariance (5.68)."""
    case, exact = case_and_bayes(1, n, r, 3)
    mean, cov = kalman_update(case.mean, case.cov, case.h, case.noise, case.z)
    gain = cov @ np.linalg.inv(case.cov)
    _, info = updated("third-order", case.system(), case.y)
    third = np.einsum("abc,ia,jb,kc->ijk", case.third, gain, gain, gain) / (1 + float(info.nu))
    sub1, _ = updated("third-order-sub1", case.system(), case.y)
    sub2, _ = updated("third-order-sub2", case.system(), case.y)
    assert_close(sub1.mean, mean)
    assert_close(sub2.mean, exact.mean)
    for moments in (sub1, sub2):
        assert_close(moments.cov, cov)
        assert_close(moments.third, third)


@pytest.mark.parametrize("name", ["linearised-kalman", "ekf", "second-order"])
@pytest.mark.parametrize(("n", "r"), [*SHAPES, (3, 3), (4, 4), (6, 2)])
def test_the_kalman_update_is_the_information_form(name, n, r):
    case = Case(2, n, r)
    moments, info = updated(name, case.system(), case.y)
    mean, cov = kalman_update(case.mean, case.cov, case.h, case.noise, case.z)
    assert_close(moments.mean, mean)
    assert_close(moments.cov, cov)
    assert_close(info.innovation, case.z)
    assert_close(info.innovation_cov, case.h @ case.cov @ case.h.T + case.noise)
    s = case.h @ case.cov @ case.h.T + case.noise
    expected = -0.5 * (case.z @ np.linalg.solve(s, case.z) + np.linalg.slogdet(2 * np.pi * s)[1])
    assert_close(info.log_likelihood, expected)


def test_third_order_update_of_fourth_order_equations_leaves_no_fourth_cumulant():
    """third-order-4 (figure 7.24): k4 = 0 after each update, whatever it was before."""
    case = Case(0, 2, 1)
    moments, _ = updated("third-order-4", case.system(fourth_moment(case.cov, case.k4)), case.y)
    without, _ = updated("third-order", case.system(), case.y)
    np.testing.assert_allclose(moments.third, without.third, rtol=1e-13)
    assert_close(moments.fourth, fourth_moment(np.asarray(moments.cov)))


def test_a_measurement_is_linearised_at_the_mean():
    """h curved: the third-order update equals that of its tangent at the mean, innovation y - h(m)."""
    case = Case(3, 2, 1)

    def observe(t, x):
        return jnp.atleast_1d(jnp.sin(x[0]) * jnp.exp(x[1]))

    h0 = np.sin(case.mean[0]) * np.exp(case.mean[1])
    case.h = np.array([[np.cos(case.mean[0]) * np.exp(case.mean[1]), h0]])
    curved = nb.System(
        drift=lambda t, x: 0 * x,
        observe=observe,
        measurement_cov=case.noise,
        initial=nb.Moments(case.mean, case.cov, case.third),
    )
    actual, info = updated("third-order", curved, np.array([h0]) + case.z)
    expected, _ = updated("third-order", case.system(), case.y)
    assert_close(info.innovation, case.z)
    for mine, theirs in zip(dense(actual)[:3], dense(expected)[:3], strict=True):
        assert_close(mine, theirs)


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_a_residual_given_by_the_system_is_the_one_used(turns):
    """An angle, wrapped to (-pi, pi]: whole turns in y change nothing."""

    def wrapped(y, h):
        return jnp.arctan2(jnp.sin(y - h), jnp.cos(y - h))

    case = Case(4, 2, 1)
    system = linear_measurement(case.mean, case.cov, case.h, case.noise, case.third, residual=wrapped)
    actual, info = updated("third-order", system, case.y + 2 * np.pi * turns)
    expected, _ = updated("third-order", case.system(), case.h @ case.mean + np.angle(np.exp(1j * case.z)))
    assert_close(info.innovation, np.angle(np.exp(1j * case.z)))
    for mine, theirs in zip(dense(actual)[:3], dense(expected)[:3], strict=True):
        assert_close(mine, theirs)


@pytest.mark.parametrize("name", ["linearised-kalman", "third-order", "third-order-sub1", "fourth-order"])
def test_a_singular_prior_covariance_is_allowed(name):
    """x2 = 2 x1 exactly: the update is that of x1 alone, with H = h1 + 2 h2, carried along (1, 2)."""
    along = np.array([1.0, 2.0])
    p, s, k4 = 0.8, 0.2, 0.1
    h, noise, y = np.array([[1.0, 0.3]]), np.array([[0.5]]), np.array([0.9])
    full = linear_measurement(
        0.0 * along,
        p * np.multiply.outer(along, along),
        h,
        noise,
        s * np.einsum("i,j,k->ijk", along, along, along),
        (k4 + 3 * p * p) * np.einsum("i,j,k,l->ijkl", along, along, along, along),
    )
    alone = linear_measurement([0.0], [[p]], h @ along[:, None], noise, [[[s]]], [[[[k4 + 3 * p * p]]]])
    actual, expected = updated(name, full, y)[0], updated(name, alone, y)[0]
    powers = [along, np.multiply.outer(along, along), np.einsum("i,j,k->ijk", along, along, along)]
    for mine, theirs, power in zip(dense(actual), dense(expected), powers, strict=False):
        if theirs is not None:
            np.testing.assert_allclose(mine, theirs.ravel()[0] * power, rtol=1e-12, atol=1e-13)
