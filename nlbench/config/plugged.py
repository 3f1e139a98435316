"""Plug-ins in an experiment: unknown names, systems that cannot be made, and which plug-ins it uses."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from nlbench import plugins
from nlbench.config.explain import Finding, validated
from nlbench.config.schema import FilterSpec, PluginSpec, PluginSystem, SystemSpec
from nlbench.errors import ConfigError
from nlbench.suggestions import closest, suggestion


def unknown(name: str, what: str, is_known: Callable[[str], bool], known: Iterable[str]) -> str:
    """What is wrong with the name of a system or filter; nothing if it is known."""
    try:
        if is_known(name):
            return ""
    except ConfigError as error:
        return str(error)
    known = list(known)
    hint = "" if closest(name, known) else plugins.hint(name)
    return f"unknown {what} '{name}'{hint}{suggestion(name, known)}"


def broken(name: str, parameters: dict[str, Any]) -> list[str]:
    """Why a plug-in makes no system of these parameters; nothing of a built-in one, which is not asked."""
    from nlbench import systems

    found = plugins.find("systems", name)
    if name in systems.MODULES or found is None:
        return []
    try:
        systems.kind(name, parameters)
    except ConfigError as error:
        return [str(problem) for problem in error.problems]
    return []


def interval(name: str, parameters: dict[str, Any]) -> float | None:
    """The time between the measurements that a system makes; None where it makes none at fixed times.

    A system of a plug-in is made to see, where code may run. Raises `ConfigError` where it cannot be made.
    """
    from nlbench import systems

    found = plugins.find("systems", name)
    if name not in systems.MODULES and found is not None and found[1].kind is None:
        made = systems.build(name, **parameters)
        return (made.truth or made).interval
    return None if parameters.get("measurement") in ("none", "continuous") else parameters.get("interval")


def used(
    system: SystemSpec | None, filters: Sequence[FilterSpec | None], given: Any
) -> tuple[list[PluginSpec], list[Finding]]:
    """The plug-ins that the experiment uses, and what of those that the file names is not at hand.

    given: the key `plugins` of the file, which a run wrote. It gives no permission.
    """
    from nlbench import systems
    from nlbench.filters.catalogue import FILTERS

    specs: dict[str, dict[str, Any]] = {}

    def noted(kind: plugins.Kind, name: str) -> dict[str, Any]:
        found = plugins.find(kind, name)
        assert found is not None
        plugin = found[0]
        facts = {"file": plugin.file, "digest": plugin.digest, "path": plugin.path, "source": plugin.source}
        return specs.setdefault(plugin.digest, {**facts, "systems": {}, "filters": []})

    if system is not None and system.name not in systems.MODULES:
        discrete, continuous = systems.kind(system.name, system.parameters)
        kind = PluginSystem(discrete=discrete, continuous=continuous)
        noted("systems", system.name)["systems"][system.name] = kind
    for name in dict.fromkeys(spec.name for spec in filters if spec):
        if name not in FILTERS:
            noted("filters", name)["filters"].append(name)
    known = system is not None and None not in filters
    return [PluginSpec(**spec) for spec in specs.values()], _absent(given, specs, known)


def _absent(given: Any, at_hand: dict[str, Any], known: bool) -> list[Finding]:
    """Findings of the key `plugins`: not what a run writes, or with other code than what is at hand.

    known: whether all that the experiment uses is; otherwise what is at hand may lack some.
    """
    findings: list[Finding] = []
    if given is not None and not isinstance(given, list):
        return [Finding(("plugins",), "filled in by a run; plug-ins are allowed with --plugin FILE.py")]
    for index, each in enumerate(given or []):
        spec, wrong = validated(PluginSpec, each, ("plugins", index))
        findings += wrong
        if spec and known and spec.digest not in at_hand:
            message = (
                f"made with other code of {spec.file} than is at hand; to run today's, leave the key out"
            )
            findings.append(Finding(("plugins", index, "digest"), message))
    return findings


def standing_in(data: dict[str, Any]) -> contextlib.AbstractContextManager[None]:
    """Within it, the plug-ins that recorded data name are known by name and kind, and no code runs."""
    given = data.get("plugins")
    specs = [validated(PluginSpec, each)[0] for each in given] if isinstance(given, list) else []
    return plugins.standing_in([spec for spec in specs if spec])


def allow(*paths: Any) -> None:
    """Run these Python files and make the systems and filters that they declare known by their names.

    Only run files whose content you trust. A file that was allowed before is read anew.
    Raises `ConfigError` saying for each which step failed.
    """
    from nlbench import systems
    from nlbench.filters.catalogue import FILTERS

    plugins.allow(*paths, taken={"systems": systems.MODULES, "filters": FILTERS})
