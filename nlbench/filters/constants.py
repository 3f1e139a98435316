"""Constants of single precision inside a system's functions, which were made before float64 was switched on.

jnp.array(500123.456) is float32 until then, off by .02, and nothing says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.blame import locate
from nlbench.errors import Problem
from nlbench.systems.system import Sets, System

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem

SINGLE = (jnp.float32, jnp.complex64, jnp.float16, jnp.bfloat16)
MOST_BITS = 16  # of a number that is let through: one that float32 has rounded needs more, but for one in 256
REMEDY = "make it with numpy, or call nlbench.configure() before jax.numpy makes it"


def find_single(system: System | DiscreteSystem) -> Iterator[Problem]:
    """Find what is of single precision where float64 is on, and may have lost digits by it: a problem for each function
    and matrix."""
    if not jax.config.read("jax_enable_x64"):
        return
    for name, matrix in _matrices(system):
        if _is_rounded(matrix):
            yield Problem(f"{name}: is of single precision, {_shown(matrix)}; {REMEDY}")
    for name, function, arguments in _functions(system):
        closed = jax.make_jaxpr(function)(*arguments)
        constants = [each for each in _constants(closed) if _is_rounded(each)]
        if constants:
            says = f"{name}: uses a constant of single precision, {_shown(constants[0])}; {REMEDY}"
            yield locate(function, says)
        elif any(_narrows(equation) for equation in _equations(closed.jaxpr)):
            yield locate(
                function, f"{name}: makes numbers of single precision; leave out the conversion, or say float"
            )


def _matrices(system: Any) -> Iterator[tuple[str, Any]]:
    yield "initial.mean", system.initial.mean
    yield "initial.cov", system.initial.cov
    for name in ("measurement_cov", "process_cov", "diffusion_cov"):
        yield name, getattr(system, name, None)


def _functions(system: System | DiscreteSystem) -> Iterator[tuple[str, Callable, tuple[Any, ...]]]:
    """Name and function of each, with arguments to trace it by."""
    x, q = jnp.zeros(system.states), len(system.measurement_cov)
    t: Any = 0.0 if isinstance(system, System) else 0
    inputs: tuple[Any, ...] = ()
    if system.inputs is not None:
        yield "inputs", system.inputs, (t,)
        inputs = (jax.eval_shape(system.inputs, t),)
    if isinstance(system, System):
        yield "drift", system.drift, (t, x, *inputs)
        yield "observe", system.observe, (t, x)
        if system.diffusion is not None:
            yield "diffusion", system.diffusion, (t, x)
        if system.sightings is not None:
            yield "sightings.observe", system.sightings.observe, (0.0, x)
            yield "sightings.angle", system.sightings.angle, (x,)
    else:
        yield "transition", system.transition, (t, x, jnp.zeros(system.noises), *inputs)
        yield "observe", system.observe, (t, x, jnp.zeros(q))
    if system.residual is not None:
        y = jnp.zeros(system.measurements)
        yield "residual", system.residual, (y, y)
    if system.error is not None:
        truth = system.states if system.truth is None else system.truth.states
        yield "error", system.error, (jnp.zeros(truth), x)
    if isinstance(system.sample, Sets):
        yield "sample.transform", system.sample.transform, (jnp.zeros((system.sample.size, system.states)),)
    elif system.sample is not None:
        yield "sample", system.sample, (jax.random.key(0),)


def _constants(closed: Any) -> Iterator[Any]:
    """Every constant of a program and of those inside it."""
    yield from closed.consts
    for equation in _equations(closed.jaxpr):
        yield from (atom.val for atom in equation.invars if hasattr(atom, "val"))
        for inner in _programs(equation):
            yield from getattr(inner, "consts", ())


def _equations(program: Any) -> Iterator[Any]:
    """Every operation of a program and of those inside it."""
    for equation in program.eqns:
        yield equation
        for inner in _programs(equation):
            yield from _equations(getattr(inner, "jaxpr", inner))


def _programs(equation: Any) -> Iterator[Any]:
    """The programs that an operation holds."""
    for value in equation.params.values():
        for each in value if isinstance(value, (tuple, list)) else (value,):
            if hasattr(each, "eqns") or hasattr(each, "jaxpr"):
                yield each


def _narrows(equation: Any) -> bool:
    """Whether an operation makes single precision of double."""
    if equation.primitive.name != "convert_element_type":
        return False
    return equation.params["new_dtype"] in SINGLE and equation.invars[0].aval.dtype == jnp.float64


def _is_rounded(value: Any) -> bool:
    """Whether a value of single precision has entries that seem rounded: that have more than a few binary digits."""
    if isinstance(value, jax.core.Tracer) or not isinstance(value, (jax.Array, np.ndarray, np.generic)):
        return False
    if value.dtype not in SINGLE:
        return False
    parts = np.asarray(value)
    parts = np.concatenate([np.ravel(parts.real), np.ravel(parts.imag)]).astype(float)
    mantissas = np.frexp(parts[np.isfinite(parts)])[0] * 2.0**MOST_BITS
    return bool((mantissas != np.round(mantissas)).any())


def _shown(value: Any) -> str:
    shape = "" if np.ndim(value) == 0 else f" of shape {np.shape(value)}"
    return f"{np.array2string(np.asarray(value), threshold=4, edgeitems=2)}{shape}"
