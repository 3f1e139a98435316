"""The registry of systems: a name, and the module that states the problem. Importing it loads no numerical library."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nlbench import plugins

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
    """Names that `build` takes, those of plug-ins last."""
    return (*(name for name in MODULES if name != OWN), *plugins.names("systems"))


def is_known(name: str) -> bool:
    """Whether there is a system of that name. Raises `ConfigError` for an installed plug-in that is broken."""
    return name in MODULES or plugins.find("systems", name) is not None


def parameters(name: str) -> type[BaseModel]:
    """The pydantic model of the system's parameters; its defaults are the published values."""
    return _module(name).Parameters


def summary(name: str) -> str:
    """One line on what the system is and where it comes from."""
    return _module(name).SUMMARY


def kind(name: str, parameters: Mapping[str, Any]) -> Kind:
    """The kind of the system of that name with these parameters, without building it.

    A module says `TIME = "discrete"` or `MEASUREMENT = "continuous"` for all parameters, or has a parameter, `time` or
    `measurement`, that decides; else time is continuous and measurements are not. That of a plug-in is built to see.
    """
    from nlbench.systems.system import Kind

    module = _module(name)
    if isinstance(module, SimpleNamespace):
        return Kind(*module.kind_of(parameters))
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

    if name in MODULES:
        return importlib.import_module(MODULES[name])
    found = plugins.find("systems", name)
    if found is None:
        known(name, (*MODULES, *plugins.names("systems")), what="system")
        raise AssertionError(name)
    return _plugged(name, *found)


def _plugged(name: str, plugin: plugins.Plugin, entry: plugins.Entry) -> Any:
    """What a module has, of a system of a plug-in."""
    what = f"system '{name}'"

    def build(parameters: BaseModel) -> Any:
        from nlbench.errors import ConfigError, Problem
        from nlbench.systems.discrete import DiscreteSystem
        from nlbench.systems.system import System

        system = plugins.made(plugin, what, entry, parameters)
        if not isinstance(system, (System, DiscreteSystem)):
            message = (
                f"{what}: made a {type(system).__name__}, expected a nlbench.System or nlbench.DiscreteSystem"
            )
            raise ConfigError([Problem(message, file=plugin.path)])
        return system

    def kind_of(parameters: Mapping[str, Any]) -> tuple[bool, bool]:
        from nlbench.checks import checked
        from nlbench.systems.system import kind

        return entry.kind or kind(build(checked(entry.parameters, parameters, where=name)))

    return SimpleNamespace(SUMMARY=entry.summary, Parameters=entry.parameters, build=build, kind_of=kind_of)
