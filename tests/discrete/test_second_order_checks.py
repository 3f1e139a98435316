"""Claim: iterated filters count a measurement once and converge; second-order means contract as they should; only the
erroneous truncated filter loses positiveness."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize

import nlbench as nb

START = nb.Moments([2.0], [[4.0]])


def still(observe, initial=START, noise=1.0):
    n = len(initial.mean)
    return nb.DiscreteSystem(lambda k, x, w: x + w, observe, np.zeros((n, n)), noise * np.eye(1), initial)


@pytest.mark.parametrize("iterations", [1, 2, 5])
def test_iterations_count_the_measurement_once(iterations):
    """On a scalar linear problem the covariance is Kalman's, P R / (P + R) = .8, whatever their number."""
    f = nb.filters.build("iekf", still(lambda k, x, v: x + v), iterations=iterations)
    state, _ = f.update(f.init(START), 0, np.array([3.0]))
    np.testing.assert_allclose(f.moments(state).cov, [[0.8]], rtol=1e-14)
    np.testing.assert_allclose(f.moments(state).mean, [2.8], rtol=1e-14)


def test_one_iteration_is_the_extended_kalman_filter():
    system = still(lambda k, x, v: x**2 / 4 + v)
    found = []
    for name, options in (("ekf", {}), ("iekf", {"iterations": 1})):
        f = nb.filters.build(name, system, **options)
        found.append(f.moments(f.update(f.init(START), 0, np.array([1.5]))[0]))
    np.testing.assert_allclose(found[0].mean, found[1].mean, rtol=1e-14)
    np.testing.assert_allclose(found[0].cov, found[1].cov, rtol=1e-14)


@pytest.mark.parametrize("y", [-1.4, 0.3, 1.4])
def test_iterations_converge_to_the_most_probable_state(y):
    """arctan, where whole Gauss-Newton steps overshoot; the mode by SciPy."""
    initial = nb.Moments([3.0], [[100.0]])
    f = nb.filters.build("iekf", still(lambda k, x, v: jnp.arctan(x) + v, initial, 0.01), iterations=60)
    state, _ = f.update(f.init(initial), 0, np.array([y]))

    def cost(x):
        return (x[0] - 3) ** 2 / 100 + (y - np.arctan(x[0])) ** 2 / 0.01

    starts = [np.array([x]) for x in np.linspace(-10, 20, 31)]
    mode = min((minimize(cost, x, options={"gtol": 1e-10}) for x in starts), key=lambda found: found.fun).x
    np.testing.assert_allclose(f.moments(state).mean, mode, atol=1e-5)


@pytest.mark.parametrize("name", ["sof", "sof-gaussian", "truncated", "modified-jazwinski", "ghkf"])
def test_the_second_order_mean_correction_of_two_products(name):
    """f = (x0^2, x0 x1), P = [[2, .3], [.3, 1]]: exactly (2, .3) above f(m)."""
    m = np.array([0.7, -1.2])
    initial = nb.Moments(m, [[2.0, 0.3], [0.3, 1.0]])
    system = nb.DiscreteSystem(
        lambda k, x, w: jnp.stack([x[0] ** 2, x[0] * x[1]]) + w,
        lambda k, x, v: x[:1] + v,
        np.zeros((2, 2)),
        np.eye(1),
        initial,
    )
    f = nb.filters.build(name, system)
    moments = f.moments(f.predict(f.init(initial), 0, 1))
    np.testing.assert_allclose(moments.mean - np.array([m[0] ** 2, m[0] * m[1]]), [2.0, 0.3], rtol=1e-13)


@pytest.mark.parametrize(
    ("name", "variance"),
    [("truncated-jazwinski", -1.0), ("modified-jazwinski", -1.0), ("truncated", 0.0), ("sof-gaussian", 2.0)],
)
def test_only_the_erroneous_truncated_prediction_loses_positiveness(name, variance):
    """x+ = x^2 at m = 0, P = 1: f_x = 0, f_xx = 2; the true variance is 2."""
    initial = nb.Moments([0.0], [[1.0]])
    system = nb.DiscreteSystem(
        lambda k, x, w: x**2 + w, lambda k, x, v: x + v, np.zeros((1, 1)), np.eye(1), initial
    )
    f = nb.filters.build(name, system)
    np.testing.assert_allclose(f.moments(f.predict(f.init(initial), 0, 1)).cov, [[variance]], atol=1e-14)


def test_a_gaussian_sum_has_the_mean_and_covariance_that_it_was_laid_out_from():
    initial = nb.Moments([1.0, -0.5], [[0.5, 0.1], [0.1, 0.3]])
    f = nb.filters.build("gaussian-sum", still(lambda k, x, v: x[:1] ** 2 + v, initial), components=4)
    moments = f.moments(f.init(initial))
    np.testing.assert_allclose(moments.mean, initial.mean, rtol=1e-13)
    np.testing.assert_allclose(moments.cov, initial.cov, rtol=1e-13)


@pytest.mark.long
def test_a_gaussian_sum_nears_the_exact_posterior_of_two_modes():
    """y = x^2/2 seen as 2 from m = .3: modes at +-2. What is missing of Bayes's mean and variance, by sums, is of
    first order in the variance that each member is left with; one EKF is far off."""
    initial, y = nb.Moments([0.3], [[2.0]]), 2.0
    system = still(lambda k, x, v: x**2 / 2 + v, initial, 0.25)
    x = np.linspace(-10, 10, 4001)
    p = np.exp(-((x - 0.3) ** 2) / 4 - (y - x**2 / 2) ** 2 / 0.5)
    p /= p.sum()
    mean = p @ x
    exact = np.array([mean, p @ (x - mean) ** 2])

    def error(**options):
        f = nb.filters.build("gaussian-sum", system, merge=0.0, **options)
        moments = f.moments(f.update(f.init(initial), 0, np.array([y]))[0])
        return np.abs(np.array([moments.mean[0], moments.cov[0, 0]]) - exact)

    coarse, fine = error(components=120, spread=0.9), error(components=120, spread=0.95)
    assert np.all((fine > 0.3 * coarse) & (fine < 0.7 * coarse))
    assert np.all(error(components=1) > 10 * fine)
