"""Shapes of what a system's functions return, checked before anything is computed or compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.shapes import Shape, compared, returned

if TYPE_CHECKING:
    from nlbench.systems.system import System


def check_shapes(system: System) -> None:
    """Raises `ConfigError` with a line for each shape that does not fit, got and expected."""
    n, m = system.states, system.measurements
    found = [
        *_array("initial.mean", system.initial.mean, (n,)),
        *_array("initial.cov", system.initial.cov, (n, n)),
        *_array("measurement_cov", system.measurement_cov, (m, m)),
        *_at_a_state("drift(t, x)", system.drift_with_inputs, n, (n,)),
        *_at_a_state("observe(t, x)", system.observe, n, (m,)),
    ]
    if system.diffusion is not None:
        s = None
        if system.diffusion_cov is not None:
            s = len(np.atleast_1d(system.diffusion_cov))
            found += _array("diffusion_cov", system.diffusion_cov, (s, s))
        found += _at_a_state("diffusion(t, x)", system.diffusion, n, (n, s))
    if found:
        raise ConfigError([Problem(each) for each in found])


def _array(name: str, array: Any, expected: Shape) -> list[str]:
    return compared(name, np.shape(array), expected)


def _at_a_state(name: str, function: Callable, n: int, expected: Shape) -> list[str]:
    return returned(name, lambda x: function(0.0, x), (n,), expected)
