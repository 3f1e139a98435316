"""The registry of systems: a name, and the module that states the problem. Importing it loads no numerical library."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import BaseModel

    from nlbench.systems.system import System

OWN = "own"  # stands in experiments for a System that was given in Python
MODULES = {
    "culver-scalar": "nlbench.systems.culver_scalar",
    "oscillator": "nlbench.systems.oscillator",
    "lunar-orbit": "nlbench.systems.lunar_orbit",
    "schwartz": "nlbench.systems.schwartz",
    OWN: "nlbench.systems.own",
}


def available() -> tuple[str, ...]:
    """Names that `build` takes."""
    return tuple(name for name in MODULES if name != OWN)


def parameters(name: str) -> type[BaseModel]:
    """The pydantic model of the system's parameters; its defaults are the published values."""
    return _module(name).Parameters


def summary(name: str) -> str:
    """One line on what the system is and where it comes from."""
    return _module(name).SUMMARY


def build(name: str, **parameters: Any) -> System:
    """The system of that name.

    Raises `ConfigError` (every problem at once) for an unknown name, an unknown parameter or a value out of range.
    """
    from nlbench.checks import checked

    module = _module(name)
    return module.build(checked(module.Parameters, parameters, where=name))


def _module(name: str) -> Any:
    from nlbench.checks import known

    return importlib.import_module(MODULES[known(name, MODULES, what="system")])
