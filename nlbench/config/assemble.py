"""Plain data to an Experiment: each section is validated, then all against each other, findings are kept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from nlbench.config import consistency, plugged
from nlbench.config.claim import Claim
from nlbench.config.explain import Finding, found, plain, validated
from nlbench.config.fields import Label, Section
from nlbench.config.places import Path
from nlbench.config.schema import (
    REFERENCES,
    EngineSpec,
    Experiment,
    FilterSpec,
    Head,
    Initial,
    Limits,
    MonteCarlo,
    Source,
    SystemSpec,
    TimeSpec,
)
from nlbench.errors import ConfigError
from nlbench.filters import catalogue
from nlbench.suggestions import closest, suggestion

MANDATORY = ("experiment", "system", "filters")
KEYS = tuple(key for key in Experiment.model_fields if key != "question")
OPTIONAL = tuple(key for key in KEYS if key not in MANDATORY)  # without a value, as if they were left out
SECTIONS: dict[str, type[Section]] = {
    "monte_carlo": MonteCarlo,
    "source": Source,
    "engine": EngineSpec,
    "limits": Limits,
}


class Named(Section):
    """What every entry of `filters` has, apart from the filter's own options."""

    name: str = Field(description="the filter")
    label: Label | None = Field(
        default=None, description="what tables and figures call it; default: its name"
    )
    model: dict[str, Any] | None = Field(
        default=None, description="parameters of the system as this filter believes them"
    )
    initial: dict[str, Any] | None = Field(default=None, description="moments that this filter starts from")


def assemble(raw: Mapping[str, Any], question: str = "") -> tuple[Experiment | None, list[Finding]]:
    """The experiment that the data state, or None, and everything that is wrong with them."""
    raw = {key: value for key, value in plain(dict(raw)).items() if value is not None or key not in OPTIONAL}
    findings = _unknown_keys(raw)
    parts: dict[str, Any] = {}
    head, wrong = validated(Head, {key: raw[key] for key in Head.model_fields if key in raw})
    findings += [each for each in wrong if each.path != ("experiment",) or "experiment" in raw]
    for key, model in SECTIONS.items():
        parts[key], wrong = validated(model, raw.get(key, {}), (key,))
        findings += wrong
    parts["initial"], wrong = _initial(raw.get("initial", {}), ("initial",))
    findings += wrong
    name, system = _system(raw, findings)
    parts["system"] = system
    parts["truth"] = _believed(name, system, raw.get("truth", {}), ("truth",), findings)
    discrete, _ = _kind(name, system, parts["truth"])
    entries = _entries(raw, findings)
    filters = parts["filters"] = [
        _filter(each, ("filters", index), name, system, findings) for index, each in enumerate(entries)
    ]
    labels = [_label(each) for each in entries] + (
        [REFERENCES[head.reference]] if head and head.reference else []
    )
    time = parts["time"] = _time(raw, system, discrete, findings)
    claims = parts["claims"] = _claims(raw, findings)
    reports = consistency.report_times(head, time)
    findings += consistency.times(time, reports, system, filters, parts["truth"])
    findings += consistency.steps(filters) if discrete else []
    findings += consistency.labels(labels, len(entries))
    findings += consistency.claims(claims, labels, reports, parts["source"])
    findings += consistency.traces(head, parts["monte_carlo"])
    parts["plugins"], wrong = plugged.used(parts["system"], filters, raw.get("plugins"))
    findings += wrong
    if findings or head is None or reports is None:
        return None, list(dict.fromkeys(findings))  # what a filter believes is looked at twice
    parts["claims"] = [each.model_copy(update={"at": each.at or reports}) for each in claims if each]
    parts.update(head.model_dump(), report_times=reports, question=_one_line(question))
    return Experiment(**parts), []


def _unknown_keys(raw: Mapping[str, Any]) -> list[Finding]:
    findings = [Finding((key,), f"missing; {_MEANINGS[key]}", True) for key in MANDATORY if key not in raw]
    nested: dict[str, str] = {}
    for section, fields in [("time", TimeSpec.model_fields)] + [
        (k, m.model_fields) for k, m in SECTIONS.items()
    ]:
        for key in fields:
            nested.setdefault(key, section)
    for key in raw:
        if key in KEYS:
            continue
        near = closest(key, [*KEYS, *nested])
        hint = f"; did you mean '{nested[near]}.{near}'?" if near in nested else suggestion(key, KEYS)
        findings.append(Finding((key,), f"unknown key{hint}", True))
    return findings


_MEANINGS = {
    "experiment": "expected the experiment's name, such as 'culver/hermite-01'",
    "system": "expected the system, such as {name: culver-scalar}",
    "filters": "expected a list of filters, such as [linearised-kalman, third-order]",
}


def _system(raw: Mapping[str, Any], findings: list[Finding]) -> tuple[str | None, SystemSpec | None]:
    """The system's name, if it is known, and the system, if all its parameters are right."""
    from nlbench import systems

    if "system" not in raw:
        return None, None
    given = _entry(raw["system"])
    if not isinstance(given, dict) or not isinstance(given.get("name"), str):
        findings.append(_nameless(given, ("system",), "system"))
        return None, None
    name = given.pop("name")
    unknown = plugged.unknown(name, "system", systems.is_known, systems.available())
    if unknown:
        findings.append(Finding(("system", "name"), unknown))
        return None, None
    parameters = _kept(validated(systems.parameters(name), given, ("system",)), findings)
    if parameters is None:
        return name, None
    stated = parameters.model_dump(mode="json")
    broken = plugged.broken(name, stated)
    findings += [Finding(("system", "name"), message) for message in broken]
    return (None, None) if broken else (name, SystemSpec(name=name, parameters=stated))


def _kind(name: str | None, system: SystemSpec | None, changed: dict[str, Any]) -> tuple[bool, bool]:
    """What kind the system is with some parameters changed, as `catalogue.KINDS`; the first where it is not known."""
    from nlbench import systems

    if name is None:
        return next(iter(catalogue.KINDS))
    try:
        return systems.kind(name, {**(system.parameters if system else {}), **changed})
    except ConfigError:  # of a plug-in's factory, which is asked again where this would be computed
        return next(iter(catalogue.KINDS))


def _entry(given: Any) -> Any:
    """A name alone is short for a mapping with nothing but that name."""
    return {"name": given} if isinstance(given, str) else dict(given) if isinstance(given, dict) else given


def _nameless(given: Any, path: Path, what: str) -> Finding:
    if isinstance(given, dict) and "name" not in given:
        misspelt = next((key for key in given if closest(str(key), ["name"])), None)
        hint = f"; did you mean 'name' instead of '{misspelt}'?" if misspelt else ""
        return Finding((*path, "name"), f"missing; expected the {what}'s name{hint}", at_key=True)
    if isinstance(given, dict):
        return Finding((*path, "name"), f"expected the {what}'s name, found {found(given['name'])}")
    return Finding(path, f"expected a {what}'s name or a mapping with one, found {found(given)}")


def _believed(
    name: str | None, system: SystemSpec | None, given: Any, path: Path, findings: list[Finding]
) -> dict[str, Any]:
    """Parameters of the system that the truth, or what a filter believes, overrides."""
    from nlbench import systems

    if not isinstance(given, dict):
        findings.append(Finding(path, f"expected a mapping of the system's parameters, found {found(given)}"))
        return {}
    if not name or not given:
        return {}
    base = system.parameters if system else {}
    parameters, wrong = validated(systems.parameters(name), {**base, **given}, path)
    findings += [each for each in wrong if system or (each.path != path and each.path[len(path)] in given)]
    return (
        {key: value for key, value in parameters.model_dump(mode="json").items() if key in given}
        if parameters
        else {}
    )


def _entries(raw: Mapping[str, Any], findings: list[Finding]) -> list[Any]:
    given = raw.get("filters", [])
    if "filters" in raw and (not isinstance(given, list) or not given):
        findings.append(Finding(("filters",), f"{_MEANINGS['filters']}, found {found(given)}"))
        return []
    return [_entry(each) for each in given]


def _label(entry: Any) -> str | None:
    """The label of an entry, as far as it can be told when other things about the entry are wrong."""
    if not isinstance(entry, dict):
        return None
    label = entry.get("label", entry.get("name"))
    return label if isinstance(label, str) else None


def _filter(
    given: Any, path: Path, system_name: str | None, system: SystemSpec | None, findings: list[Finding]
) -> FilterSpec | None:
    if not isinstance(given, dict) or not isinstance(given.get("name"), str):
        findings.append(_nameless(given, path, "filter"))
        return None
    before = len(findings)
    named = _kept(
        validated(Named, {key: given[key] for key in Named.model_fields if key in given}, path), findings
    )
    name, options, at = given["name"], None, (*path, "name")
    model = _believed(system_name, system, given.get("model") or {}, (*path, "model"), findings)
    kind = _kind(system_name, system, model)
    known = catalogue.available()
    if unknown := plugged.unknown(name, "filter", known.__contains__, known):
        findings.append(Finding(at, unknown))
    elif refused := catalogue.refusal(name, *kind):
        findings.append(Finding(at, f"'{name}' {refused}"))
    else:
        own = {key: value for key, value in given.items() if key not in Named.model_fields}
        options = _kept(validated(catalogue.options(name, *kind), own, path), findings)
    initial, wrong = _initial(given.get("initial") or {}, (*path, "initial"))
    findings += wrong
    if len(findings) > before or named is None or options is None:
        return None
    options = options.model_dump(mode="json")
    return FilterSpec(name=name, label=named.label or name, options=options, model=model, initial=initial)


def _initial(given: Any, path: Path) -> tuple[dict[str, Any], list[Finding]]:
    initial, findings = validated(Initial, given, path)
    return (initial.moments() if initial else {}), findings


def _time(
    raw: Mapping[str, Any], system: SystemSpec | None, discrete: bool, findings: list[Finding]
) -> TimeSpec | None:
    """The times; what the file leaves out follows from the system's interval between measurements."""
    given = raw.get("time", {})
    if not isinstance(given, dict):
        return _kept(validated(TimeSpec, given, ("time",)), findings)
    defaults = consistency.default_times(system, given, discrete) if system else {}
    if system is None and any(key not in given for key in TimeSpec.model_fields):
        return None
    time = _kept(validated(TimeSpec, {**defaults, **given}, ("time",)), findings)
    if not discrete or time is None or time.step == 1:
        return time
    findings.append(
        Finding(("time", "step"), f"time is discrete, so a step is 1, found {time.step:g}; leave it out")
    )
    return time.model_copy(update={"step": 1.0})


def _one_line(question: str) -> str:
    """The question as a comment can hold it."""
    return "".join(letter if letter.isprintable() else " " for letter in question).strip()


def _claims(raw: Mapping[str, Any], findings: list[Finding]) -> list[Claim | None]:
    given = raw.get("claims", [])
    if not isinstance(given, list):
        findings.append(Finding(("claims",), f"expected a list of claims, found {found(given)}"))
        return []
    return [_kept(validated(Claim, each, ("claims", index)), findings) for index, each in enumerate(given)]


def _kept(result: tuple[Any, list[Finding]], findings: list[Finding]) -> Any:
    findings += result[1]
    return result[0]
