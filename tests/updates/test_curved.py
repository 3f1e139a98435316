"""Claim: the updates that look beyond the linearised measurement are Bayes's rule to the order that each claims."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from tests.oracle import bayes, fourth_moment, kalman_update, random_cov, rng, symmetrise
from tests.problems import dense, linear_measurement, updated

pytestmark = pytest.mark.long  # minutes of compiling, all filters together

CURVED = (
    "series-3", "series-4", "integration-update", "two-step-2", "two-step-3", "direct-2", "direct-3",
    "quadrature-2", "quadrature-3",
)  # fmt: skip
INTEGRALS = ("direct-2", "direct-3", "quadrature-2", "quadrature-3")


class Problem:
    """A random third-order prior of two states, and what is seen of it: an angle, or an angle and a distance.

    Ten standard deviations from the origin, where the angle is not smooth.
    """

    def __init__(self, seed, measurements=1):
        g = rng((seed, measurements))
        self.mean, self.cov = np.array([4.0, 2.0]) + 0.2 * g.normal(size=2), 0.15 * random_cov(g, 2)
        root = np.linalg.cholesky(self.cov)
        self.third = np.einsum("abc,ia,jb,kc->ijk", 0.3 * symmetrise(g.normal(size=(2,) * 3)), *[root] * 3)
        self.noise = np.diag([0.005, 0.05][:measurements])
        self.measurements = measurements
        self.y = self.seen(np, self.mean + root @ g.normal(size=2))

    def seen(self, xp, x):
        angle, distance = xp.arctan2(x[1], x[0]), xp.sqrt(x[0] ** 2 + x[1] ** 2)
        return xp.stack([angle, distance][: self.measurements])

    def system(self, **more):
        return nb.System(
            drift=lambda t, x: 0 * x,
            observe=lambda t, x: self.seen(jnp, x),
            measurement_cov=self.noise,
            initial=nb.Moments(self.mean, self.cov, self.third),
            **more,
        )


@cache
def problem_and_bayes(seed, measurements, order):
    problem = Problem(seed, measurements)
    third = problem.third if order == 3 else None
    exact = bayes(
        problem.mean, problem.cov, third, None, lambda x: problem.seen(np, x), problem.noise, problem.y, 81
    )
    return problem, exact


def distance(moments, exact):
    """The largest error of the moments carried, each relative to the largest component of that moment."""
    pairs = [(a, b) for a, b in zip(dense(moments), exact[:4], strict=True) if a is not None]
    return max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)


@pytest.mark.parametrize("measurements", [1, 2])
@pytest.mark.parametrize("name", INTEGRALS)
def test_numerical_integration_is_bayes_for_a_curved_measurement(name, measurements):
    problem, exact = problem_and_bayes(0, measurements, int(name[-1]))
    options = {"points": 25} if name.startswith("quadrature") else {}
    moments, info = updated(name, problem.system(), problem.y, **options)
    assert distance(moments, exact) < 1e-8
    np.testing.assert_allclose(info.log_likelihood, np.log(exact.evidence), atol=1e-9)


def test_quadrature_converges_geometrically():
    """Each four nodes more take a factor of ten at least off the error, until rounding."""
    problem, exact = problem_and_bayes(1, 2, 3)
    errors = [
        distance(updated("quadrature-3", problem.system(), problem.y, points=points)[0], exact)
        for points in (5, 9, 13, 17)
    ]
    assert errors[0] < 0.05
    for before, after in pairwise(errors):
        assert after < max(before / 10, 1e-10)


@pytest.mark.parametrize("name", ["quadrature-2", "quadrature-3"])
def test_five_nodes_are_exact_for_a_linear_measurement(name):
    problem = Problem(2)
    h, y = np.array([[0.6, -1.1]]), np.array([0.4])
    system = linear_measurement(problem.mean, problem.cov, h, problem.noise, problem.third)
    third = problem.third if name.endswith("3") else None
    exact = bayes(problem.mean, problem.cov, third, None, lambda x: h @ x, problem.noise, y)
    moments, info = updated(name, system, y, points=5)
    assert distance(moments, exact) < 1e-9
    np.testing.assert_allclose(info.log_likelihood, np.log(exact.evidence), atol=1e-9)


def test_nodes_follow_an_accurate_measurement_far_from_the_prior():
    """R a hundred times below the prior variance, five prior sigmas away, y = x^3: the mode is found and centred on."""
    cube, noise, y = (lambda x: x**3), np.array([[0.02]]), np.array([15.0])
    system = nb.System(lambda t, x: 0 * x, lambda t, x: cube(x), noise, nb.Moments([1.0], [[0.1]]))
    moments, info = updated("quadrature-2", system, y, points=15)
    grid = np.linspace(2.0, 3.0, 400_001)
    log_joint = -0.5 * ((grid - 1) ** 2 / 0.1 + (y - grid**3) ** 2 / 0.02)
    weights = np.exp(log_joint - log_joint.max())
    mean = np.sum(weights * grid) / weights.sum()
    evidence = np.sum(weights) * (grid[1] - grid[0]) / (2 * np.pi * np.sqrt(0.1 * 0.02))
    np.testing.assert_allclose(moments.mean, [mean], rtol=1e-9)
    np.testing.assert_allclose(
        moments.cov, [[np.sum(weights * (grid - mean) ** 2) / weights.sum()]], rtol=1e-6
    )
    np.testing.assert_allclose(info.log_likelihood, np.log(evidence) + log_joint.max(), rtol=1e-9)


def linear_scalar(noise, k4=0.05):
    """Mean 2, variance .8, skewed; the measurement's residual is as many of its sigmas for every `noise`."""
    p, s = 0.8, 0.15
    fourth = [[[[3 * p * p + k4]]]]
    return linear_measurement([2.0], [[p]], np.eye(1), [[noise]], [[[s]]], fourth), np.array(
        [2.0 + 0.7 * np.sqrt(noise)]
    )


ORDERS = {"corrected": (3.0, 2.5, 2.0, 1.5), "printed": (1.5, None, None, None)}


@pytest.mark.parametrize("equations", ORDERS)
def test_series_errors_fall_with_the_noise_as_the_first_terms_left_out_do(equations):
    """In powers of 1/R, against the exact fourth-order update; the printed mean lacks m times the rest of K."""
    errors = []
    for noise in (400.0, 1600.0):
        system, y = linear_scalar(noise)
        series, _ = updated("series-4", system, y, equations=equations)
        exact, _ = updated("fourth-order", system, y)
        errors.append([np.abs(a - b).max() for a, b in zip(dense(series), dense(exact), strict=True)])
    orders = np.log(np.array(errors[0]) / errors[1]) / np.log(4.0)
    for order, expected in zip(orders, ORDERS[equations], strict=True):
        if expected is not None:
            assert abs(order - expected) < 0.15


def test_corrected_series_is_the_same_wherever_the_origin_is():
    """C6: shifting state and measurement shifts the mean, and the printed mean besides."""
    moves = {}
    for equations in ("corrected", "printed"):
        shifts = []
        for origin in (0.0, 10.0):
            system, y = linear_scalar(2.0)
            third, fourth = system.initial.third, system.initial.fourth
            moved = linear_measurement([2.0 + origin], [[0.8]], np.eye(1), [[2.0]], third, fourth)
            moments, _ = updated("series-4", moved, y + origin, equations=equations)
            shifts.append(float(moments.mean[0]) - 2.0 - origin)
        moves[equations] = abs(shifts[1] - shifts[0])
    assert moves["corrected"] < 1e-13
    assert moves["printed"] > 1e-3


def test_integration_update_approaches_kalmans_with_order_four_in_its_steps():
    problem, h, noise = Problem(3), np.array([[1.0, 0.5]]), np.array([[0.2]])
    y = h @ problem.mean + 0.2
    system = linear_measurement(problem.mean, problem.cov, h, noise)
    mean, cov = kalman_update(problem.mean, problem.cov, h, noise, np.array([0.2]))
    errors = []
    for steps in (10, 20, 40):
        moments, _ = updated("integration-update", system, y, steps=steps)
        errors.append(max(np.abs(moments.mean - mean).max(), np.abs(moments.cov - cov).max()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4) < 0.4)


def test_corrected_tempering_is_nearer_to_bayes_than_the_printed_update():
    """C7: with the Wong-Zakai term the mean's error is smaller by far, for a skewed prior."""
    errors = {}
    system, y = linear_scalar(1.0)
    exact = bayes([2.0], np.array([[0.8]]), np.array([[[0.15]]]), None, lambda x: x, np.eye(1), y)
    for equations in ("corrected", "printed"):
        moments, _ = updated("integration-update", system, y, equations=equations, steps=50)
        errors[equations] = abs(float(moments.mean[0]) - exact.mean[0])
    assert errors["corrected"] < errors["printed"] / 5


def thesis_measurement(third):
    """The prior of chapter 7 at its start, and y = 3x - .5x^2 (7.10), where it bends most."""
    system = nb.System(
        lambda t, x: 0 * x,
        lambda t, x: 3 * x - 0.5 * x**2,
        np.array([[1.6]]),
        nb.Moments([2.0], [[0.16]], third),
    )
    return system, np.array([3.0])


def bayes_of_thesis(third, y):
    return bayes([2.0], np.array([[0.16]]), third, None, lambda x: 3 * x - 0.5 * x**2, np.array([[1.6]]), y)


def test_two_step_updates_beat_linearised_ones_on_the_thesis_measurement():
    """Mean, covariance, third moment and log-likelihood."""
    third = np.array([[[0.01]]])
    system, y = thesis_measurement(third)
    for name, linearised, order in (("two-step-2", "second-order", 2), ("two-step-3", "third-order", 3)):
        exact = bayes_of_thesis(third if order == 3 else None, y)
        found, likelihood = zip(*(updated(each, system, y) for each in (name, linearised)), strict=True)
        for mine, theirs, truth in zip(
            dense(found[0])[:order], dense(found[1])[:order], exact[:order], strict=True
        ):
            assert np.abs(mine - truth).max() < np.abs(theirs - truth).max() / 5
        mine, theirs = (abs(float(info.log_likelihood) - np.log(exact.evidence)) for info in likelihood)
        assert mine < theirs / 5


def test_corrected_two_step_is_nearer_to_bayes_than_the_printed_one():
    """C5: the third moment, and through it the variance."""
    third = np.array([[[0.01]]])
    system, y = thesis_measurement(third)
    exact = bayes_of_thesis(third, y)
    corrected, _ = updated("two-step-3", system, y)
    printed, _ = updated("two-step-3", system, y, equations="printed")
    assert (
        abs(corrected.third.item() - exact.third.item()) < abs(printed.third.item() - exact.third.item()) / 3
    )
    assert abs(corrected.cov.item() - exact.cov.item()) < abs(printed.cov.item() - exact.cov.item()) / 3


def test_tempering_keeps_the_curvature_when_asked():
    third = np.array([[[0.01]]])
    system, y = thesis_measurement(third)
    exact = bayes_of_thesis(third, y)
    bent, bent_info = updated("integration-update", system, y, measurement="quadratic")
    straight, straight_info = updated("integration-update", system, y)
    for mine, theirs, truth in zip(dense(bent)[:3], dense(straight)[:3], exact[:3], strict=True):
        assert np.abs(mine - truth).max() < np.abs(theirs - truth).max() / 3
    mine, theirs = (
        abs(float(info.log_likelihood) - np.log(exact.evidence)) for info in (bent_info, straight_info)
    )
    assert mine < theirs / 3


@pytest.mark.parametrize("name", CURVED)
def test_a_limited_residual_is_as_if_that_had_been_measured(name):
    problem = Problem(5, 2)
    system = problem.system()
    h = problem.seen(np, problem.mean)
    slope = np.stack(
        [
            [-problem.mean[1], problem.mean[0]] / np.sum(problem.mean**2),
            problem.mean / np.sqrt(np.sum(problem.mean**2)),
        ]
    )
    bound = 0.5 * np.sqrt(np.diag(slope @ problem.cov @ slope.T + problem.noise))
    z = np.array([1.2, -0.1]) * bound
    limited, info = updated(name, system, h + z, limiter=0.5)
    moved, _ = updated(name, system, h + np.clip(z, -bound, bound))
    assert distance(limited, (*dense(moved)[:3], dense(moved)[3])) < 1e-10
    np.testing.assert_allclose(info.innovation, z, rtol=1e-12)


@pytest.mark.parametrize("name", ["two-step-3", "direct-3", "quadrature-3"])
@pytest.mark.parametrize("u", [-3.2, 1.0])
def test_the_guard_is_that_of_the_third_order_filter_for_a_linear_measurement(name, u):
    """Fires where 1 + nu < .25 or the covariance is not positive, and then leaves sub1 and its Gaussian likelihood."""
    system = linear_measurement([0.0], np.eye(1), np.eye(1), [[0.5]], [[[1.8]]])
    y = np.array([u * np.sqrt(1.5)])
    moments, info = updated(name, system, y, guard="sub1")
    expected, reference = updated("third-order-guarded", system, y)
    assert bool(info.guarded) == bool(reference.guarded) == (u < 0)
    for mine, theirs in zip(dense(moments)[:3], dense(expected)[:3], strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-7)
    np.testing.assert_allclose(info.log_likelihood, reference.log_likelihood, rtol=1e-7)
    np.testing.assert_allclose(info.nu, reference.nu, rtol=1e-7)


@pytest.mark.parametrize("name", ["direct-2", "quadrature-3", "two-step-3"])
@pytest.mark.parametrize("turns", [-1, 2])
def test_a_wrapped_residual_is_wrapped_everywhere(name, turns):
    def wrapped(y, h):
        return jnp.arctan2(jnp.sin(y - h), jnp.cos(y - h))

    problem = Problem(6)
    plain, _ = updated(name, problem.system(), problem.y)
    turned, _ = updated(name, problem.system(residual=wrapped), problem.y + 2 * np.pi * turns)
    assert distance(turned, (*dense(plain)[:3], None)) < 1e-11


def test_quadratic_tempering_rates_refuse_a_fourth_moment():
    moments = nb.Moments([0.0], [[1.0]], [[[0.0]]], fourth_moment(np.eye(1)))
    with pytest.raises(ValueError, match="linear measurement"):
        nb.updates.tempering_rates(moments, [0.0], [0.1], [[1.0]], [[1.0]], M=[[[0.1]]])


@pytest.mark.parametrize("name", CURVED)
def test_a_missing_entry_of_a_curved_measurement_is_as_if_it_were_not_there(name):
    both, angle = Problem(5, 2), Problem(5, 1)
    start = nb.Moments(both.mean, both.cov, both.third)
    fewer = nb.System(lambda t, x: 0 * x, lambda t, x: angle.seen(jnp, x), angle.noise, start)
    actual, info = updated(name, both.system(), np.array([both.y[0], np.nan]))
    expected, reference = updated(name, fewer, both.y[:1])
    assert distance(actual, dense(expected)) < 1e-11
    np.testing.assert_allclose(info.log_likelihood, reference.log_likelihood, rtol=1e-11)


@pytest.mark.parametrize("measurement", ["linear", "quadratic"])
def test_likelihood_of_tempering_is_right_to_first_order_in_the_information(measurement):
    """log p(y) - log N(y - h; 0, R) begins with the mean of l under the prior, which is exact: the error is O(R^-2)."""
    third = np.array([[[0.03]]])

    def observe(x):
        return 3 * x - 0.5 * x**2 if measurement == "quadratic" else 0.7 * x

    errors = []
    for noise in (400.0, 800.0):
        system = nb.System(
            lambda t, x: 0 * x,
            lambda t, x: observe(x),
            np.array([[noise]]),
            nb.Moments([2.0], [[0.16]], third),
        )
        y = np.array([6.0])
        exact = bayes([2.0], np.array([[0.16]]), third, None, observe, np.array([[noise]]), y)
        _, info = updated("integration-update", system, y, measurement=measurement, steps=20)
        errors.append(abs(float(info.log_likelihood) - np.log(exact.evidence)))
    assert errors[0] / errors[1] > 3.5


def test_likelihood_of_the_two_step_update_is_right_to_first_order_in_the_curvature():
    third = np.array([[[0.03]]])
    errors = []
    for bend in (0.04, 0.02):

        def observe(x, bend=bend):
            return x + bend * (x - 2.0) ** 2

        system = nb.System(
            lambda t, x: 0 * x, lambda t, x: observe(x), np.array([[0.3]]), nb.Moments([2.0], [[0.16]], third)
        )
        y = np.array([2.8])
        exact = bayes([2.0], np.array([[0.16]]), third, None, observe, np.array([[0.3]]), y)
        _, info = updated("two-step-3", system, y)
        errors.append(abs(float(info.log_likelihood) - np.log(exact.evidence)))
    assert errors[0] / errors[1] > 3.5
