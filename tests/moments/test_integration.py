"""Claim: over an interval the moments follow the exact solution of a linear system, and RK4 has order 4."""

from __future__ import annotations

import contextlib
from typing import get_args

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import nlbench as nb
from nlbench import solvers
from nlbench.moments import integrate
from tests.oracle import fourth_moment, random_cov, rng, symmetrise

F = np.array([[-0.3, 1.0], [-1.2, -0.2]])
C = np.array([0.4, -0.1])
V = np.array([[0.3, 0.1], [0.1, 0.2]])


def linear_system(initial, **more):
    return nb.System(
        drift=lambda t, x: jnp.asarray(F) @ x + C,
        observe=lambda t, x: x[:1],
        measurement_cov=np.eye(1),
        initial=initial,
        **more,
    )


def predicted(name, system, t1, **options):
    f = nb.filters.build(name, system, **options)
    return f.moments(jax.jit(lambda state: f.predict(state, 0.0, t1))(f.init(system.initial)))


def start(n=2, seed=1):
    g = rng(seed)
    cov = random_cov(g, n)
    third = 0.2 * symmetrise(g.normal(size=(n, n, n)))
    k4 = 0.2 * symmetrise(g.normal(size=(n, n, n, n)))
    return nb.Moments(g.normal(size=n), cov, third, fourth_moment(cov, k4))


@pytest.mark.parametrize("name", ["linearised-kalman", "second-order", "third-order", "fourth-order"])
def test_linear_mean_and_covariance_follow_their_exact_solution(name):
    """dm = F m + c, dP = F P + P F' + V by scipy at 1e-12; RK4 with step .002 leaves about h^4 = 2e-11."""
    initial = start()
    system = linear_system(initial, diffusion=lambda t, x: jnp.eye(2), diffusion_cov=V)

    def rate(t, v):
        p = v[2:].reshape(2, 2)
        return np.concatenate([F @ v[:2] + C, (F @ p + p @ F.T + V).ravel()])

    v0 = np.concatenate([initial.mean, np.ravel(initial.cov)])
    v = solve_ivp(rate, (0, 0.8), v0, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    moments = predicted(name, system, 0.8, step=0.002)
    np.testing.assert_allclose(moments.mean, v[:2], atol=1e-10)
    np.testing.assert_allclose(moments.cov, v[2:].reshape(2, 2), atol=1e-10)


@pytest.mark.parametrize("name", ["third-order", "fourth-order"])
def test_linear_third_and_fourth_moments_are_carried_by_the_transition_matrix(name):
    """Without noise x - m = E (x0 - m0): every central moment is the initial one with an E on each index."""
    initial = start()
    e = expm(0.8 * F)
    moments = predicted(name, linear_system(initial), 0.8, step=0.002)
    np.testing.assert_allclose(
        moments.third, np.einsum("abc,ia,jb,kc->ijk", initial.third, e, e, e), atol=1e-10
    )
    if name == "fourth-order":
        expected = np.einsum("abcd,ia,jb,kc,ld->ijkl", initial.fourth, e, e, e, e)
        np.testing.assert_allclose(moments.fourth, expected, atol=1e-10)


@pytest.mark.parametrize("name", ["linearised-kalman", "second-order", "third-order", "fourth-order"])
def test_fixed_steps_converge_with_order_four(name):
    """On a nonlinear system halving the step divides the error by 16 (here within 14 to 18)."""
    initial = nb.Moments([2.0], [[0.16]], [[[0.02]]], None)
    system = nb.System(
        drift=lambda t, x: -2 * x + 0.7 * x**2,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=initial,
    )

    def values(step):
        m = predicted(name, system, 0.8, step=step)
        return np.concatenate([np.ravel(part) for part in m if part is not None])

    exact = values(0.001)
    errors = [np.abs(values(step) - exact) for step in (0.04, 0.02)]
    assert np.all(errors[1] > 1e-10), "rounding would hide the order"
    ratio = errors[0] / errors[1]
    assert np.all((ratio > 14) & (ratio < 18)), ratio


@pytest.mark.parametrize("solver", ["Tsit5", "Dopri8"])
def test_a_diffrax_solver_by_name_agrees_within_its_tolerance(solver):
    system = linear_system(start())
    fine = predicted("third-order", system, 0.8, step=0.002)
    other = predicted("third-order", system, 0.8, integrator={"solver": solver, "rtol": 1e-9, "atol": 1e-9})
    for mine, theirs in zip(other[:3], fine[:3], strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-7)


def test_an_interval_is_covered_in_steps_of_the_option():
    """One RK4 step over .8 differs from ten of .08: the step in force is the option's."""
    system = linear_system(start())
    coarse, fine = (np.asarray(predicted("second-order", system, 0.8, step=s).cov) for s in (0.8, 0.08))
    assert np.abs(coarse - fine).max() > 1e-4


NAMED = [*get_args(solvers.Adaptive), *get_args(solvers.Fixed), *get_args(solvers.Implicit)]
OTHERS = sorted(
    name
    for name, each in vars(diffrax).items()
    if isinstance(each, type) and issubclass(each, diffrax.AbstractSolver) and name not in NAMED
)


def integrates(name, rtol=None):
    integrator = integrate.by_name(name, rtol)
    jax.eval_shape(lambda y: integrator.integrate(lambda t, y: -y, 0.0, 0.1, 2, y), np.ones(2))


@pytest.mark.parametrize("name", NAMED)
def test_a_solver_that_options_name_integrates_as_they_say(name):
    fixed, adaptive = name not in get_args(solvers.Implicit), name not in get_args(solvers.Fixed)
    for rtol, works in ((None, fixed), (1e-6, adaptive)):
        with contextlib.nullcontext() if works else pytest.raises(Exception, match="solver"):
            integrates(name, rtol)


def test_no_solver_of_diffrax_that_integrates_is_missing():
    for name in OTHERS:
        for rtol in (None, 1e-6):
            with pytest.raises((TypeError, ValueError, RuntimeError)):
                integrates(name, rtol)
