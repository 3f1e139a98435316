"""One step under a measurement held over it: the rule of Euler, in Ito's sense, or an integrator of ordinary equations.

Held measurements of variance Gamma/h drive the rates as white noise does. Steps of Euler then converge to the solution
in Ito's sense, which is what the filters' equations mean. Runge-Kutta and its like follow the held noise through the
step, and converge to the Stratonovich reading: another drift, hence another filter (Culver 1969, 4.7, found it
"unstable"). Rates that do not multiply the noise by the state, as those of a linear system, have one reading only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax

from nlbench.moments import integrate as integration

if TYPE_CHECKING:
    from nlbench.continuous.catalogue import Integrator

State = Any  # a pytree of arrays
Field = Callable[[Any, State], State]  # (t, state) -> its rates, the measurement held
Step = Callable[[Field, Field, Any, Any, State], State]  # (field, Ito field, t, h, state) -> state


def euler(field: Field, ito_field: Field, t: Any, h: Any, state: State) -> State:
    """state + h rates, with the rates of Ito's calculus."""
    return jax.tree.map(lambda value, rate: value + h * rate, state, ito_field(t, state))


def build(chosen: Integrator) -> Step:
    """The step of an integrator that a filter's options name."""
    if chosen.solver == "euler":
        return euler
    integrator = integration.build(**chosen.model_dump())
    return lambda field, ito_field, t, h, state: integrator.integrate(field, t, h, 1, state)
