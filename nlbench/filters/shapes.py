"""Shapes of what a system states and its functions return, checked before anything is computed or compiled."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.filters.called import returned
from nlbench.shapes import as_floats, compared
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem


def check_shapes(system: System | DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape that does not fit, got and expected."""
    found = [Problem(line) for line in _stated(system)]
    if all(
        each.message.startswith("initial.cov") for each in found
    ):  # all that says of what size arguments are is right
        found += _functions(system)
    if found:
        raise ConfigError(found)


def _stated(system: System | DiscreteSystem) -> Iterator[str]:
    """What is wrong with the initial moments and the matrices."""
    initial = system.initial
    if not (hasattr(initial, "mean") and hasattr(initial, "cov")):
        yield f"initial: got {type(initial).__name__}, expected nlbench.Moments(mean, cov)"
        return
    mean = getattr(initial.mean, "shape", None)
    n = mean[0] if mean else 1
    for name, array, expected in (("mean", initial.mean, (n,)), ("cov", initial.cov, (n, n))):
        yield from _array(f"initial.{name}", array) or compared(f"initial.{name}", np.shape(array), expected)
    matrices = {"measurement_cov": system.measurement_cov}
    if isinstance(system, System):
        matrices |= {} if system.diffusion_cov is None else {"diffusion_cov": system.diffusion_cov}
    else:
        matrices["process_cov"] = system.process_cov
    for name, matrix in matrices.items():
        yield from _array(name, matrix) or _square(name, np.shape(matrix))


def _array(name: str, value: Any) -> list[str]:
    """What is wrong with a value that is no array of real numbers: a line or none."""
    real = hasattr(value, "shape") and not np.issubdtype(value.dtype, np.complexfloating)
    return [] if real else [f"{name}: got {value!r}, expected a number or an array of real numbers"]


def _square(name: str, shape: tuple[int, ...]) -> list[str]:
    if len(shape) == 1:
        return [f"{name}: got shape {shape}, expected a square matrix; np.diag makes one of variances"]
    return compared(name, shape, shape[:1] * 2 or (1, 1))


def _functions(system: System | DiscreteSystem) -> Iterator[Problem]:
    """What is wrong with the functions that move and measure the state."""
    n, q = (system.states,), len(system.measurement_cov)
    timed = isinstance(system, System)
    t: Any = 0.0 if timed else 0
    inputs: tuple[Any, ...] = ()
    if system.inputs is not None:
        wrong = returned(f"inputs({'t' if timed else 'k'})", system.inputs, (t,), None)
        yield from wrong
        if wrong:
            return
        inputs = (jax.eval_shape(system.inputs, t),)
    if not isinstance(system, System):
        yield from returned("transition(k, x, w)", system.transition, (t, n, (system.noises,), *inputs), n)
        yield from returned("observe(k, x, v)", system.observe, (t, n, (q,)), (None,))
        return
    yield from returned("drift(t, x)", system.drift, (t, n, *inputs), n)
    yield from returned("observe(t, x)", system.observe, (t, n), (q,))
    if system.diffusion is not None:
        s = None if system.diffusion_cov is None else len(system.diffusion_cov)
        yield from returned("diffusion(t, x)", system.diffusion, (t, n), (*n, s))
    if system.sightings is not None:
        observe = as_floats(system.sightings.observe, 1)
        yield from returned("sightings.observe(mark, x)", observe, (0.0, n), (q,))
        yield from returned("sightings.angle(x)", system.sightings.angle, (n,), ())
