"""Claim: the damped method finds minima of sums of squares, also where Gauss-Newton's own steps do not lead there."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares as scipy_least_squares

from nlbench.references.levenberg import least_squares


def misfit(module, x):
    """Of x0 exp(-x1 t) + x2 to made-up data, with a weak prior."""
    t = np.linspace(0, 4, 12)
    y = 3 * np.exp(-1.3 * t) + 0.5 + 0.05 * np.cos(9 * t)
    model = x[0] * module.exp(-x[1] * t) + x[2]
    return module.concatenate([(y - model) / 0.1, 0.1 * x])


def test_finds_the_minimum_that_scipy_finds():
    start = np.array([1.0, 0.2, 0.0])
    fit = jax.jit(lambda x: least_squares(partial(misfit, jnp), x, 15))(start)
    expected = scipy_least_squares(partial(misfit, np), start, xtol=1e-15, ftol=1e-15, gtol=1e-12)
    np.testing.assert_allclose(fit.point, expected.x, rtol=1e-6)
    np.testing.assert_allclose(fit.level, expected.cost, rtol=1e-12)
    np.testing.assert_allclose(fit.information, expected.jac.T @ expected.jac, rtol=1e-4)
    np.testing.assert_allclose(fit.gradient, 0, atol=1e-6)


def test_one_step_solves_a_linear_problem():
    J, y = np.random.default_rng(0).normal(size=(6, 3)), np.arange(6.0)
    fit = least_squares(lambda x: y - jnp.asarray(J) @ x, jnp.full(3, 5.0), 1)
    np.testing.assert_allclose(fit.point, np.linalg.lstsq(J, y)[0], rtol=1e-10)


def test_a_step_that_leads_up_is_taken_back():
    """For arctan x, from 2, Gauss-Newton's steps grow without bound."""
    residuals = lambda x: jnp.arctan(x)  # noqa: E731
    start, undamped = jnp.array([2.0]), 2.0
    for _ in range(3):
        undamped -= np.arctan(undamped) * (1 + undamped**2)
    assert abs(undamped) > 100
    levels = [float(least_squares(residuals, start, steps).level) for steps in (0, 1, 2, 4, 12)]
    assert (np.diff(levels) <= 0).all()
    np.testing.assert_allclose(levels[-1], 0, atol=1e-12)


def test_a_point_that_is_not_a_number_is_taken_back():
    fit = least_squares(lambda x: jnp.sqrt(x) - 0.1, jnp.array([4.0]), 15)
    np.testing.assert_allclose(fit.point, [0.01], rtol=1e-6)
