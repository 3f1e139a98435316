"""The system of an experiment file, as far as it is stated rightly: its name, parameters, kind and interval."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from nlbench.config import plugged
from nlbench.config.explain import Finding, found, sound, validated
from nlbench.config.places import Path
from nlbench.config.schema import SystemSpec
from nlbench.config.times import Time, is_time
from nlbench.errors import ConfigError
from nlbench.filters import catalogue
from nlbench.suggestions import closest

DECIDE_KIND = {"time", "measurement"}  # parameters of built-in systems, if they have them


class Stated(NamedTuple):
    """The system as far as the file states it rightly.

    name: None where it is unknown. parameters: defaults included, None for one that is wrong. given, wrong: names of
    those that the file writes, and of those that are wrong. spec: None where anything is wrong.
    """

    name: str | None = None
    parameters: Mapping[str, Any] = {}
    given: frozenset[str] = frozenset()
    wrong: frozenset[str] = frozenset()
    spec: SystemSpec | None = None


def read_system(raw: Mapping[str, Any], findings: list[Finding]) -> Stated:
    """Read the key `system`; what is wrong with it is added to the findings."""
    from nlbench import systems

    if "system" not in raw:
        return Stated()
    given = expand_entry(raw["system"])
    if not isinstance(given, dict) or not isinstance(given.get("name"), str):
        findings.append(refuse_nameless(given, ("system",), "system"))
        return Stated()
    name = given.pop("name")
    unknown = plugged.unknown(name, "system", systems.is_known, systems.available())
    if unknown:
        findings.append(Finding(("system", "name"), unknown))
        return Stated()
    parameters, found_wrong = _parameters(name, given, ("system",))
    findings += found_wrong
    wrong = frozenset(str(each.path[1]) for each in found_wrong if len(each.path) > 1)
    broken = [] if found_wrong else plugged.broken(name, parameters)
    findings += [Finding(("system", "name"), message) for message in broken]
    if broken:
        return Stated()
    spec = None if found_wrong else SystemSpec(name=name, parameters=parameters)
    return Stated(name, parameters, frozenset(given), wrong, spec)


def _parameters(name: str, given: dict[str, Any], path: Path) -> tuple[dict[str, Any], list[Finding]]:
    """Parameters of a system as far as they are right, defaults included, and what is wrong with them."""
    from nlbench import systems

    model = systems.parameters(name)
    parameters, wrong = validated(model, given, path)
    right = parameters or sound(model, given, wrong, path)
    return right.model_dump(mode="json", warnings=False), wrong


def list_kinds(system: Stated, changed: dict[str, Any]) -> list[tuple[bool, bool]]:
    """List the kinds, as in `catalogue.KINDS`, that the system may be of with some parameters changed.

    It is one where all that decides it is right.
    """
    from nlbench import systems

    every = list(catalogue.KINDS)
    decisive = system.wrong & DECIDE_KIND if system.name in systems.MODULES else system.wrong
    if system.name is None or decisive:
        return every
    try:
        return [systems.kind(system.name, {**system.parameters, **changed})]
    except ConfigError:  # of a plug-in's factory, which is asked again where this would be computed
        return every


def read_beliefs(system: Stated, given: Any, path: Path, findings: list[Finding]) -> dict[str, Any]:
    """Read parameters of the system that the truth, or what a filter believes, overrides: those that are right."""
    if not isinstance(given, dict):
        findings.append(Finding(path, f"expected a mapping of the system's parameters, found {found(given)}"))
        return {}
    if not system.name or not given:
        return {}
    parameters, wrong = _parameters(system.name, {**system.parameters, **given}, path)
    mine = [each for each in wrong if each.path[len(path) :][:1] in [(key,) for key in given]]
    findings += wrong if system.spec else mine
    bad = {each.path[len(path)] for each in mine}
    return {key: value for key, value in parameters.items() if key in given and key not in bad}


def find_interval(system: Stated, truth: Mapping[str, Any]) -> Time | None:
    """The time between measurements of what makes the data; None where it is not known or there is none."""
    if system.name is None:
        return None
    parameters = {**system.parameters, **truth}
    try:
        value = plugged.interval(system.name, parameters)
    except ConfigError:
        return None
    if not is_time(value):
        return None
    holder = "truth" if "interval" in truth else "system" if "interval" in system.given else ""
    if holder and value == parameters["interval"]:
        return Time(value, f"{holder}.interval", (holder, "interval"))
    return Time(value, "the time between measurements")


def expand_entry(given: Any) -> Any:
    """A name alone is short for a mapping with nothing but that name."""
    return {"name": given} if isinstance(given, str) else dict(given) if isinstance(given, dict) else given


def refuse_nameless(given: Any, path: Path, what: str) -> Finding:
    """Say what is wrong with an entry that has no name."""
    if isinstance(given, dict) and "name" not in given:
        misspelt = next((key for key in given if closest(str(key), ["name"])), None)
        hint = f"; did you mean 'name' instead of '{misspelt}'?" if misspelt else ""
        return Finding((*path, "name"), f"missing; expected the {what}'s name{hint}", at_key=True)
    if isinstance(given, dict):
        return Finding((*path, "name"), f"expected the {what}'s name, found {found(given['name'])}")
    return Finding(path, f"expected a {what}'s name or a mapping with one, found {found(given)}")
