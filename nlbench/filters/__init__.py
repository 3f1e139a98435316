"""Named filters: `available` lists them, `build` binds one to a system. Importing this loads no numerical library."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nlbench.filters.catalogue import FILTERS, available, options, row, summary

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.system import System

__all__ = ["available", "build", "options", "summary"]


def build(name: str, system: System, **options: Any) -> Filter:
    """The filter of that name for a system.

    options: those of `nlbench.filters.options(name)`.
    Raises `ConfigError` for an unknown name or option, where the filter does not apply to the system,
    and where what the system's functions return has the wrong shape.
    """
    from nlbench.checks import checked, known
    from nlbench.errors import ConfigError
    from nlbench.runtime import ensure_precision
    from nlbench.systems.system import System as ContinuousTime

    known(name, FILTERS, what="filter")
    found = row(
        name,
        discrete=not isinstance(system, ContinuousTime),
        continuous=isinstance(system, ContinuousTime) and system.measurement == "continuous",
    )
    if found.family == "moment" and not isinstance(system, ContinuousTime):
        raise ConfigError(f"{name}: integrates a drift in time, and the system's time is discrete")
    chosen = checked(found.options, options, where=name)
    ensure_precision()
    if isinstance(system, ContinuousTime):
        from nlbench.filters.shapes import check_shapes

        check_shapes(system)
    if found.family == "reference":
        from nlbench.references import build as build_reference

        return build_reference(system)
    return _builder(found.family)(name, found, system, chosen)


def _builder(family: str) -> Callable[..., Filter]:
    """What builds the filters of a family: (name, row, system, options) -> Filter."""
    if family == "continuous":
        from nlbench.continuous import build
    elif family == "discrete":
        from nlbench.discrete import build
    else:
        from nlbench.filters.moment import build
    return build
