"""Integration of an ordinary differential equation over fixed steps: our staged RK4, or any diffrax solver by name.

The same objects integrate the moment equations and the truth. `StagedRK4` is a diffrax solver, so `diffeqsolve` takes
it too; its `advance` is the step of the hot loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

State = Any  # a pytree of arrays
Field = Callable[[Any, State], State]  # (t, y) -> dy/dt

# Numbers of components. From the first on, recomputing the early stages costs more than keeping them; above the second,
# stages as a loop are faster to compile and to run.
KEEP_FROM = 3
LOOP_ABOVE = 8


class StagedRK4(diffrax.AbstractSolver):
    """The classical fourth-order Runge-Kutta method with a fixed step.

    looped: run the four stages as a loop, which keeps large systems of equations fast to compile and to run; None
        decides by the number of components.
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
        return (_looped_step if looped else _unrolled_step)(field, t, h, y)


def _unrolled_step(field: Field, t: Any, h: Any, y: State) -> State:
    """Stages in a row. XLA forms each component of the result by itself and recomputes most stages for each; with
    several components it is made to keep the first two, by a loop whose single turn it cannot foresee."""

    def second(k1: State) -> State:
        return field(t + h / 2, _moved(y, h / 2, k1))

    k1 = field(t, y)
    if len(jax.tree.leaves(y)) < KEEP_FROM:
        k2 = second(k1)
    else:
        once = jnp.where(t == t, 1, 0)
        k1, k2 = jax.lax.fori_loop(0, once, lambda _, k: (k[0], second(k[0])), (k1, k1))
    k3 = field(t + h / 2, _moved(y, h / 2, k2))
    k4 = field(t + h, _moved(y, h, k3))
    return jax.tree.map(lambda y, a, b, c, d: y + h / 6 * (a + 2 * (b + c) + d), y, k1, k2, k3, k4)


def _looped_step(field: Field, t: Any, h: Any, y: State) -> State:
    """Stages 2 to 4 as a loop. The sum takes in the slope of the stage before, which is at hand and so not formed
    again for it."""

    def stage(s: Any, carry: tuple[State, State]) -> tuple[State, State]:
        k, total = carry
        ahead = h * jnp.where(s == 2, 1.0, 0.5)
        total = _moved(total, h * jnp.where(s == 0, 1 / 6, 1 / 3), k)
        return field(t + ahead, _moved(y, ahead, k)), total

    k, total = jax.lax.fori_loop(0, 3, stage, (field(t, y), y))
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
