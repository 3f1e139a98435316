"""nlbench: which nonlinear filter is better on a problem, by how much, at what cost, and when it breaks."""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "Moments": "nlbench.moments.moments",
    "System": "nlbench.systems.system",
    "DiscreteSystem": "nlbench.systems.discrete",
    "Coordinate": "nlbench.systems.system",
    "compare": "nlbench.comparison",
    "Results": "nlbench.notebook",
    "allow": "nlbench.config",
    "configure": "nlbench.runtime",
    "filter_data": "nlbench.filters.data",
    "load": "nlbench.config",
    "plan": "nlbench.engine",
    "replay": "nlbench.engine",
    "run": "nlbench.notebook",
    "algebra": None,
    "orbit": None,
    "filters": None,
    "systems": None,
    "updates": None,
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Public names are loaded when first used, so that importing nlbench costs nothing."""
    if name not in _HOMES:
        raise AttributeError(f"module 'nlbench' has no attribute '{name}'")
    home = _HOMES[name]
    return (
        importlib.import_module(f"nlbench.{name}")
        if home is None
        else getattr(importlib.import_module(home), name)
    )


def __dir__() -> list[str]:
    return __all__
