"""Shapes of what a system in discrete time gives and returns, checked before anything is computed or compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.shapes import compared, returned

if TYPE_CHECKING:
    from nlbench.systems.discrete import DiscreteSystem


def check_shapes(system: DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape that does not fit, got and expected."""
    n = system.states
    found = [
        *compared("initial.mean", np.shape(system.initial.mean), (n,)),
        *compared("initial.cov", np.shape(system.initial.cov), (n, n)),
        *_square("process_cov", system.process_cov),
        *_square("measurement_cov", system.measurement_cov),
    ]
    if not found:
        s, q = len(system.process_cov), len(system.measurement_cov)
        transition, observe = system.transition_with_inputs, system.observe
        found += returned("transition(k, x, w)", lambda x, w: transition(0, x, w), (n, s), (n,))
        found += returned("observe(k, x, v)", lambda x, v: observe(0, x, v), (n, q), (None,))
    if found:
        raise ConfigError([Problem(each) for each in found])


def _square(name: str, array: Any) -> list[str]:
    shape = np.shape(array)
    fits = len(shape) == 2 and shape[0] == shape[1]
    return [] if fits else [f"{name}: got shape {shape}, expected a square matrix"]
