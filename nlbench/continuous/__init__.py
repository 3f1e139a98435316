"""Filters of continuous measurements, y = dz/dt = h + white noise. Importing this loads no numerical library."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlbench.continuous.catalogue import Options
    from nlbench.filters.filter import Filter
    from nlbench.row import Row
    from nlbench.systems.system import System

__all__ = ["build"]


def build(name: str, row: Row, system: System, options: Options) -> Filter:
    """The filter of a catalogue row, bound to a system. Raises `ConfigError` where it does not apply."""
    from nlbench.continuous.bind import bind

    return bind(name, row, system, options)
