"""Filters for discrete time and noise that need not be additive; they take systems in continuous time as well."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

MODULES = {
    "linearised": "kalman",
    "iterated": "iterated",
    "athans": "sof",
    "gaussian": "sof",
    "truncated": "truncated",
    "statistical": "statistical",
    "sigma-point": "sigma_point",
    "mixture": "gaussian_sum",
    "ensemble": "ensemble",
    "particles": "bootstrap",
}


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """The filter of a row of `catalogue`, bound to a system.

    Raises `ConfigError` where the system's measurements are continuous, where the filter does not apply, and where
    shapes do not fit.
    """
    from nlbench.discrete.shapes import check_shapes
    from nlbench.systems.discrete import DiscreteSystem

    if isinstance(system, DiscreteSystem):
        check_shapes(system)
    elif system.measurement == "continuous":
        raise ConfigError(f"{name}: takes measurements at discrete times, and the system's are continuous")
    return importlib.import_module(f"nlbench.discrete.{MODULES[row.update]}").build(
        name, row, system, options
    )
