"""Named filters: `available` lists them, `build` binds one to a system. Importing this loads no numerical library."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from nlbench.filters.catalogue import available, options, refusal, row, summary

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

__all__ = ["available", "build", "check", "options", "summary"]


def build(name: str, system: System | DiscreteSystem, **options: Any) -> Filter:
    """The filter of that name for a system.

    options: those of `nlbench.filters.options(name, discrete, continuous)` for a system of that kind.
    Raises `ConfigError` for an unknown name or option, where the filter does not apply to the system,
    where what the system's functions return has the wrong shape, and where they are not finite, or a
    derivative that the filter takes is not, at its start.
    """
    from nlbench.checks import checked, known
    from nlbench.errors import ConfigError
    from nlbench.filters.derivatives import refuse_singular
    from nlbench.runtime import ensure_precision
    from nlbench.shapes import as_moments
    from nlbench.systems.system import kind

    of = kind(system)
    found = row(known(name, available(), what="filter"), *of)
    refused = refusal(name, *of)
    if refused:
        raise ConfigError(f"{name}: {refused}")
    chosen = checked(found.options, options, where=name)
    ensure_precision()
    check(system)
    if found.family == "reference":
        from nlbench.references import build as build_reference

        bound = build_reference(system)
    else:
        bound = _builder(found.family)(name, found, system, chosen)
    step = 1.0 if of.discrete else getattr(chosen, "step", None) or getattr(system, "default_step", None)
    start = bound.init
    bound = bound._replace(step=step, init=lambda moments, key=None: start(as_moments(moments), key))
    refuse_singular(name, found, chosen, bound)
    return bound


def check(system: System | DiscreteSystem) -> None:
    """Raises `ConfigError` with a line for each shape in a system that does not fit, got and expected."""
    from nlbench.filters import rules, shapes

    shapes.check_shapes(system)
    rules.check_rules(system)


def _builder(family: str) -> Callable[..., Filter]:
    """What builds the filters of a family: (name, row, system, options) -> Filter."""
    if family == "continuous":
        from nlbench.continuous import build
    elif family == "discrete":
        from nlbench.discrete import build
    elif family == "plugin":
        from nlbench.filters.plugged import build
    elif family == "baseline":
        from nlbench.filters.unfiltered import build
    else:
        from nlbench.filters.moment import build
    return build
