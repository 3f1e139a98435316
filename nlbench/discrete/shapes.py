"""Shapes of what a system in discrete time gives and returns, checked before anything is computed or compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.discrete.problem import stacked
from nlbench.errors import ConfigError, Problem

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem


def check_shapes(system: DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape that does not fit, got and expected."""
    n = system.states
    found = [
        *_compared("initial.mean", np.shape(system.initial.mean), (n,)),
        *_compared("initial.cov", np.shape(system.initial.cov), (n, n)),
        *_square("process_cov", system.process_cov),
        *_square("measurement_cov", system.measurement_cov),
    ]
    if not found:
        s, q = len(system.process_cov), len(system.measurement_cov)
        found += _returned("transition(k, x, w)", system.transition_with_inputs, n, s, (n,))
        found += _returned("observe(k, x, v)", system.observe, n, q, None)
    if found:
        raise ConfigError([Problem(each) for each in found])


def _square(name: str, array: Any) -> list[str]:
    shape = np.shape(array)
    fits = len(shape) == 2 and shape[0] == shape[1]
    return [] if fits else [f"{name}: got shape {shape}, expected a square matrix"]


def _returned(name: str, function: Callable, n: int, s: int, expected: tuple[int, ...] | None) -> list[str]:
    """expected: None for a vector of any length."""
    try:
        shape = jax.eval_shape(lambda x, w: stacked(function(0, x, w)), jnp.zeros(n), jnp.zeros(s)).shape
    except Exception as error:
        return [f"{name}: raises {type(error).__name__} for shapes ({n},) and ({s},): {_first_line(error)}"]
    if expected is None:
        return [] if len(shape) == 1 else [f"{name}: got shape {shape}, expected a vector"]
    return _compared(name, shape, expected)


def _compared(name: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> list[str]:
    return [] if shape == expected else [f"{name}: got shape {shape}, expected {expected}"]


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0] if str(error) else ""
