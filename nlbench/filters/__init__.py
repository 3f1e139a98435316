"""Named filters: `available` lists them, `build` binds one to a system. Importing this loads no numerical library."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.filters.catalogue import FILTERS, available, options, summary

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
    from nlbench.runtime import ensure_precision

    row = FILTERS[known(name, FILTERS, what="filter")]
    chosen = checked(row.options, options, where=name)
    ensure_precision()
    from nlbench.filters.shapes import check_shapes

    check_shapes(system)
    if name == "exact":
        from nlbench.references import build as build_reference

        return build_reference(system)
    from nlbench.filters import moment

    return moment.build(name, row, system, chosen)
