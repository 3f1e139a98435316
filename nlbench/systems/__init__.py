"""The registry of systems: a name, and the module that states the problem. Importing it loads no numerical library."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pydantic import BaseModel

    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import Kind, System

OWN = "own"  # stands in experiments for a system that was given in Python
MODULES = {
    "culver-scalar": "nlbench.systems.culver_scalar",
    "oscillator": "nlbench.systems.oscillator",
    "lunar-orbit": "nlbench.systems.lunar_orbit",
    "schwartz": "nlbench.systems.schwartz",
    "aircraft-radar": "nlbench.systems.aircraft_radar",
    "submarine": "nlbench.systems.submarine",
    "satellite-radar": "nlbench.systems.satellite_radar",
    "parameter-identification": "nlbench.systems.parameter_identification",
    "state-dependent-noise": "nlbench.systems.state_dependent_noise",
    "positiveness": "nlbench.systems.positiveness",
    "rippled-sensor": "nlbench.systems.rippled_sensor",
    "ungm": "nlbench.systems.growth",
    "bearings-only": "nlbench.systems.bearings_only",
    "re-entry": "nlbench.systems.reentry",
    "falling-body": "nlbench.systems.falling_body",
    "cubic-sensor": "nlbench.systems.cubic_sensor",
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


def kind(name: str, parameters: Mapping[str, Any]) -> Kind:
    """The kind of the system of that name with these parameters, without building it.

    A module says `TIME = "discrete"` or `MEASUREMENT = "continuous"` for all parameters, or has a parameter, `time` or
    `measurement`, that decides; else time is continuous and measurements are not.
    """
    from nlbench.systems.system import Kind

    module = _module(name)
    return Kind(
        discrete=getattr(module, "TIME", parameters.get("time")) == "discrete",
        continuous=getattr(module, "MEASUREMENT", parameters.get("measurement")) == "continuous",
    )


def build(name: str, **parameters: Any) -> System | DiscreteSystem:
    """The system of that name.

    Raises `ConfigError` (every problem at once) for an unknown name, an unknown parameter or a value out of range.
    """
    from nlbench.checks import checked

    module = _module(name)
    return module.build(checked(module.Parameters, parameters, where=name))


def _module(name: str) -> Any:
    from nlbench.checks import known

    return importlib.import_module(MODULES[known(name, MODULES, what="system")])
