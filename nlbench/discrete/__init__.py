"""Filters for discrete time and noise that need not be additive; they take systems in continuous time as well."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """The filter of a row of `catalogue`, whose update is a module of this package, bound to a system.

    Raises `ConfigError` where it does not apply.
    """
    return importlib.import_module(f"nlbench.discrete.{row.update}").build(name, row, system, options)
