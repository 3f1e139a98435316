"""Integration of an ordinary differential equation over fixed steps: our staged RK4, or any diffrax solver by name.

The same objects integrate the moment equations and the truth. `StagedRK4` is a diffrax solver, so `diffeqsolve` takes
it too; its `advance` is the step of the hot loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from nlbench.algebra import shared

State = Any  # a pytree of arrays
Field = Callable[[Any, State], State]  # (t, y) -> dy/dt

LOOP_ABOVE = 60  # components, above which stages as a loop save more of compiling than they cost in running


class StagedRK4(diffrax.AbstractSolver):
    """The classical fourth-order Runge-Kutta method with a fixed step.

    looped: run the stages as a loop, which keeps large systems of equations fast to compile; None decides by the
        number of components.
    """

    looped: bool | None = eqx.field(static=True, default=None)
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms: Any) -> int:
        """Order of convergence."""
        return 4

    def init(self, terms: Any, t0: Any, t1: Any, y0: State, args: Any) -> None:
        """No state is carried from step to step."""

    def func(self, terms: Any, t0: Any, y0: State, args: Any) -> State:
        """The vector field."""
        return terms.vf(t0, y0, args)

    def step(
        self, terms: Any, t0: Any, t1: Any, y0: State, args: Any, solver_state: None, made_jump: Any
    ) -> tuple[State, None, dict[str, State], None, Any]:
        """One step of diffrax from t0 to t1."""
        y1 = self.advance(lambda t, y: terms.vf(t, y, args), t0, t1 - t0, y0)
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful

    def advance(self, field: Field, t: Any, h: Any, y: State) -> State:
        """y one step of h later."""
        looped = len(jax.tree.leaves(y)) > LOOP_ABOVE if self.looped is None else self.looped
        traced_once = jax.jit(field)
        return (_looped_step if looped else _unrolled_step)(traced_once, t, h, y)


def _unrolled_step(field: Field, t: Any, h: Any, y: State) -> State:
    """Stages in a row."""

    def step(y: State) -> State:
        k1 = field(t, y)
        k2 = field(t + h / 2, _moved(y, h / 2, k1))
        k3 = field(t + h / 2, _moved(y, h / 2, k2))
        k4 = field(t + h, _moved(y, h, k3))
        return jax.tree.map(lambda y, a, b, c, d: y + h / 6 * (a + 2 * (b + c) + d), y, k1, k2, k3, k4)

    return shared(step, t, y)


def _looped_step(field: Field, t: Any, h: Any, y: State) -> State:
    """Stages 2 to 4 as a loop. The sum takes in the slope of the stage before, which is at hand."""

    def stage(s: Any, carry: tuple[State, State]) -> tuple[State, State]:
        ahead = h * jnp.where(s == 2, 1.0, 0.5)
        weight = h * jnp.where(s == 0, 1 / 6, 1 / 3)

        def next(k: State, total: State) -> tuple[State, State]:
            return field(t + ahead, _moved(y, ahead, k)), _moved(total, weight, k)

        return shared(next, t, *carry)

    k, total = jax.lax.fori_loop(0, 3, stage, (shared(lambda y: field(t, y), t, y), y))
    return _moved(total, h / 6, k)


def _moved(y: State, h: Any, k: State) -> State:
    return jax.tree.map(lambda y, k: y + h * k, y, k)


class Integrator(NamedTuple):
    """integrate(field, t, h, count, y): y after `count` steps of `h` from `t`; count is an integer, known or traced."""

    integrate: Callable[[Field, Any, Any, Any, State], State]


def fixed_rk4() -> Integrator:
    """Steps of `StagedRK4`."""
    solver = StagedRK4()

    def integrate(field: Field, t: Any, h: Any, count: Any, y: State) -> State:
        if isinstance(count, int) and count == 1:
            return solver.advance(field, t, h, y)
        return jax.lax.fori_loop(0, count, lambda i, y: solver.advance(field, t + i * h, h, y), y)

    return Integrator(integrate)


def by_name(name: str, rtol: float | None = None, atol: float | None = None) -> Integrator:
    """The diffrax solver of that name; adaptive with tolerances, at fixed steps without.

    A solve that fails (too many steps) leaves NaN, to be counted. Raises `AttributeError` for an unknown name.
    """
    solver = getattr(diffrax, name)()
    adaptive = rtol is not None or atol is not None
    controller = (
        diffrax.PIDController(rtol=rtol or 1e-6, atol=atol or 1e-9)
        if adaptive
        else diffrax.ConstantStepSize()
    )

    def integrate(field: Field, t: Any, h: Any, count: Any, y: State) -> State:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, args: field(t, y)),
            solver,
            t0=t,
            t1=t + count * h,
            dt0=h,
            y0=y,
            stepsize_controller=controller,
            throw=False,
            max_steps=None if not adaptive else 16**4,
        )
        succeeded = solution.result == diffrax.RESULTS.successful
        return jax.tree.map(lambda end: jnp.where(succeeded, end[0], jnp.nan), solution.ys)

    return Integrator(integrate)


def build(solver: str, rtol: float | None = None, atol: float | None = None) -> Integrator:
    """`fixed_rk4` for "rk4", otherwise the diffrax solver of that name."""
    return fixed_rk4() if solver == "rk4" else by_name(solver, rtol, atol)


def steps_between(t0: Any, t1: Any, longest: float | None) -> tuple[Any, Any]:
    """Length and number of the equal steps from t0 to t1, none longer than `longest` (None: a tenth of the way)."""
    span = t1 - t0
    if longest is None:
        return span / 10, 10
    if isinstance(span, (int, float)):
        count = max(1, math.ceil(span / longest - 1e-9))
        return span / count, count
    count = jnp.maximum(1, jnp.ceil(span / longest - 1e-9)).astype(int)
    return span / count, count
