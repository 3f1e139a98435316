"""Claim: the staged RK4 of the hot loop is the classical method, and the same object is a diffrax solver."""

from __future__ import annotations

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nlbench.moments.integrate import StagedRK4, build
from tests.oracle import rk4

LOOPED = pytest.mark.parametrize("looped", [False, True])
Y0 = np.array([0.4, -1.0, 0.3])


def field(t, y):
    return jnp.stack([y[1], -y[0] - 2 * y[1] * y[2] + jnp.sin(t), -0.3 * y[2] ** 2])


def numpy_field(t, y):
    return np.array([y[1], -y[0] - 2 * y[1] * y[2] + np.sin(t), -0.3 * y[2] ** 2])


@LOOPED
def test_one_step_is_the_classical_step(looped):
    actual = StagedRK4(looped=looped).advance(field, 0.2, 0.1, jnp.asarray(Y0))
    np.testing.assert_allclose(actual, rk4(numpy_field, Y0, 0.2, 0.3, 1), rtol=1e-14)


@LOOPED
def test_inside_diffeqsolve_it_equals_the_loop(looped):
    solver = StagedRK4(looped=looped)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: field(t, y)), solver, t0=0.0, t1=1.0, dt0=0.05, y0=jnp.asarray(Y0)
    )
    looped_ = jax.jit(lambda y: build("rk4").integrate(field, 0.0, 0.05, 20, y))(jnp.asarray(Y0))
    np.testing.assert_allclose(solution.ys[-1], looped_, rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(looped_, rk4(numpy_field, Y0, 0.0, 1.0, 20), rtol=1e-13)


def test_a_known_and_a_traced_number_of_steps_agree():
    integrate = build("rk4").integrate
    known = jax.jit(lambda y: integrate(field, 0.0, 0.05, 7, y))(jnp.asarray(Y0))
    traced = jax.jit(lambda y, n: integrate(field, 0.0, 0.05, n, y))(jnp.asarray(Y0), 7)
    np.testing.assert_allclose(known, traced, rtol=1e-14)


def test_diffrax_solvers_come_by_name_with_fixed_steps_or_tolerances():
    fine = rk4(numpy_field, Y0, 0.0, 1.0, 2000)
    fixed = build("Tsit5").integrate(field, 0.0, 0.02, 50, jnp.asarray(Y0))
    adaptive = build("Dopri5", rtol=1e-10, atol=1e-10).integrate(field, 0.0, 0.5, 2, jnp.asarray(Y0))
    np.testing.assert_allclose(fixed, fine, atol=1e-9)
    np.testing.assert_allclose(adaptive, fine, atol=1e-8)


def test_a_solve_that_fails_leaves_nan():
    """x' = x^2 from 1 escapes at t = 1; nothing raises, the trajectory becomes NaN."""
    end = build("Tsit5", rtol=1e-8, atol=1e-8).integrate(lambda t, y: y**2, 0.0, 0.1, 20, jnp.ones(1))
    assert np.isnan(end).all()
