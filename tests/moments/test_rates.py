"""Claim: the rates of orders 1-4 are expectations of the generator under the density that the order assumes.

Exact for quadratic drift and G(x) affine in x; the oracle sums over a Gauss-Hermite rule.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle import fourth_moment, hermite_density, moment_rates, random_cov, rng, symmetrise
from tests.problems import quadratic

ORDERS = {2: "second-order", 3: "third-order", 4: "fourth-order"}
NOISES = ("none", "additive", "affine")


class Case:
    """Random moments, a quadratic drift and a diffusion G(x) = G0 + G1 x with noise covariance V."""

    def __init__(self, seed, n, noise):
        g = rng(seed)
        s = {"none": 1, "additive": n, "affine": 2}[noise]
        self.mean, self.cov = g.normal(size=n), random_cov(g, n)
        self.third = 0.3 * symmetrise(g.normal(size=(n, n, n)))
        self.k4 = 0.3 * symmetrise(g.normal(size=(n, n, n, n)))
        self.value, self.slope = g.normal(size=n), g.normal(size=(n, n))
        half = 0.5 * g.normal(size=(n, n, n))
        self.half = (half + half.transpose(0, 2, 1)) / 2
        self.v = random_cov(g, s)
        self.g0 = g.normal(size=(n, s)) * (noise != "none")
        self.g1 = g.normal(size=(n, s, n)) * (noise == "affine")
        self.noise = noise

    def drift(self, x):
        e = x - self.mean
        return self.value + self.slope @ e + np.einsum("iab,a,b->i", self.half, e, e)

    def diffusion_cov(self, x):
        g = self.g0 + self.g1 @ x
        return g @ self.v @ g.T

    def rates(self, order, drift=None, name=None):
        fourth = fourth_moment(self.cov, self.k4) if order == 4 else None
        moments = nb.Moments(self.mean, self.cov, self.third if order > 2 else None, fourth)
        noise = {}
        if self.noise != "none":
            noise = {
                "diffusion": lambda t, x: jnp.asarray(self.g0) + jnp.asarray(self.g1) @ x,
                "diffusion_cov": self.v,
            }
        system = nb.System(
            drift=drift or quadratic(self.mean, self.value, self.slope, self.half),
            observe=lambda t, x: x,
            measurement_cov=np.eye(len(self.mean)),
            initial=moments,
            **noise,
        )
        f = nb.filters.build(name or ORDERS[order], system)
        return f.rates(f.init(moments), 0.0)

    def expected(self, order):
        density = hermite_density(
            self.mean, self.cov, self.third if order > 2 else None, self.k4 if order == 4 else None
        )
        return moment_rates(density, self.mean, self.drift, self.diffusion_cov)


def assert_rates(rates, expected, order):
    actual = (rates.mean, rates.cov, rates.third, rates.fourth)
    for k, (mine, theirs) in enumerate(zip(actual, expected, strict=True), start=1):
        if k <= order:
            np.testing.assert_allclose(mine, theirs, rtol=1e-10, atol=1e-10 * max(1, np.abs(theirs).max()))


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("n", [1, 2])
@pytest.mark.parametrize("order", ORDERS)
def test_rates_are_expectations_under_the_assumed_density(order, n, noise):
    for seed in range(2):
        case = Case(10 * n + seed, n, noise)
        assert_rates(case.rates(order), case.expected(order), order)


@pytest.mark.parametrize("n", [1, 2])
def test_first_order_rates_are_those_of_the_system_linearised_at_the_mean(n):
    """dm = f(m), dP = F P + P F' + G V G' with everything at m."""
    case = Case(n, n, "affine")
    rates = case.rates(1, name="linearised-kalman")
    np.testing.assert_allclose(rates.mean, case.value, rtol=1e-12)
    expected = case.slope @ case.cov + case.cov @ case.slope.T + case.diffusion_cov(case.mean)
    np.testing.assert_allclose(rates.cov, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("order", ORDERS)
def test_a_curved_drift_counts_through_its_second_order_taylor_expansion(order):
    """The derivatives come from jax: a drift with sines has the rates of its expansion at the mean."""

    def curved(t, x):
        return jnp.stack([jnp.sin(x[0]) * x[1], jnp.exp(-x[0]) - x[1] ** 3])

    case = Case(5, 2, "additive")
    case.value = np.asarray(curved(0.0, jnp.asarray(case.mean)))
    case.slope = np.asarray(jax.jacfwd(curved, 1)(0.0, jnp.asarray(case.mean)))
    case.half = np.asarray(jax.hessian(curved, 1)(0.0, jnp.asarray(case.mean))) / 2
    assert_rates(case.rates(order, drift=curved), case.expected(order), order)


def test_rates_follow_an_explicit_time():
    case = Case(3, 1, "none")
    system = nb.System(
        drift=lambda t, x: -t * x,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(case.mean, case.cov),
    )
    f = nb.filters.build("second-order", system)
    rates = f.rates(f.init(system.initial), 0.7)
    np.testing.assert_allclose(rates.mean, -0.7 * case.mean, rtol=1e-14)
    np.testing.assert_allclose(rates.cov, -1.4 * case.cov, rtol=1e-14)


@pytest.mark.parametrize("order", [3, 4])
def test_a_gaussian_on_a_linear_system_stays_gaussian(order):
    """dS = 0 and d mu4 = 3{P dP} + 3{dP P}: the closure's own check (equations sheet, section 5)."""
    case = Case(4, 2, "additive")
    case.half, case.third, case.k4 = 0 * case.half, 0 * case.third, 0 * case.k4
    rates = case.rates(order)
    np.testing.assert_allclose(rates.third, 0, atol=1e-13)
    if order == 4:
        dp = np.asarray(rates.cov)
        expected = 6 * symmetrise(np.multiply.outer(case.cov, dp))
        np.testing.assert_allclose(rates.fourth, expected, rtol=1e-12, atol=1e-12)


def simple(drift, **more):
    """Rates of a two-state system from fixed moments."""
    moments = nb.Moments(np.array([0.4, -0.7]), np.array([[0.3, 0.1], [0.1, 0.2]]), 0.05 * np.ones((2, 2, 2)))
    system = nb.System(
        drift=drift, observe=lambda t, x: x, measurement_cov=np.eye(2), initial=moments, **more
    )
    f = nb.filters.build("third-order", system)
    return f.rates(f.init(moments), 0.3)[:3]


def assert_same(rates, expected):
    for mine, theirs in zip(rates, expected, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-13, atol=1e-14)


def test_a_drift_may_return_a_tuple_of_scalars():
    stacked = simple(lambda t, x: jnp.stack([x[1], -(x[0] ** 2)]))
    assert_same(simple(lambda t, x: (x[1], -(x[0] ** 2))), stacked)


def test_known_inputs_enter_the_drift():
    with_input = simple(
        lambda t, x, u: jnp.stack([x[1] * u[0], u[1] - x[0]]), inputs=lambda t: jnp.array([t, t**2])
    )
    assert_same(with_input, simple(lambda t, x: jnp.stack([0.3 * x[1], 0.09 - x[0]])))


def test_a_diffusion_without_a_covariance_has_unit_noise():
    def drift(t, x):
        return -x

    g = np.array([[0.2, 0.5], [0.0, 0.7]])
    plain = simple(drift, diffusion=lambda t, x: jnp.asarray(g))
    assert_same(plain, simple(drift, diffusion=lambda t, x: jnp.asarray(g), diffusion_cov=np.eye(2)))
    np.testing.assert_allclose(plain[1] - simple(drift)[1], g @ g.T, rtol=1e-13, atol=1e-15)
