"""Plain data to an Experiment: each section is validated, then all against each other, findings are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import Field

from nlbench.config import consistency, plugged, stated, times, written
from nlbench.config.claim import APART, Claim
from nlbench.config.explain import Finding, Model, found, plain, sound, validated
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
    TimeSpec,
)
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
    """The experiment that the data state, or None, and everything that is wrong with them.

    What is wrong hides nothing that is wrong whatever stands in its place.
    """
    raw = {key: value for key, value in plain(dict(raw)).items() if value is not None or key not in OPTIONAL}
    findings = _unknown_keys(raw)
    given = {key: raw[key] for key in Head.model_fields if key in raw}
    head = _section(Head, {"experiment": "missing", **given}, (), findings)
    parts: dict[str, Any] = {
        key: _section(model, raw.get(key, {}), (key,), findings) for key, model in SECTIONS.items()
    }
    parts["initial"], wrong = _initial(raw.get("initial", {}), ("initial",))
    findings += wrong
    system = stated.read_system(raw, findings)
    parts["truth"] = stated.read_beliefs(system, raw.get("truth", {}), ("truth",), findings)
    entries = _entries(raw, findings)
    filters = [_filter(each, ("filters", index), system, findings) for index, each in enumerate(entries)]
    claims = _claims(raw, findings)
    told = {each.path for each in findings}
    given_times = written.gather(raw, head, entries, claims, system, parts["truth"], findings)
    parts["time"], wrong = times.settle(given_times)
    findings += wrong
    reports = written.report_times(raw, given_times, parts["time"], told)
    labels = [_label(each) for each in entries]
    if head.reference or ("reference",) in told:
        labels.append(REFERENCES.get(head.reference or ""))
    findings += consistency.labels(labels, len(entries))
    numbers = {("source",), ("source", "figures"), ("source", "tables")}
    source = None if numbers & {path[:2] for path in told} else parts["source"]
    findings += consistency.claims(claims, labels, reports, source)
    findings += consistency.traces(head.traces or [], parts["monte_carlo"].runs)
    parts["plugins"], wrong = plugged.used(system.spec, filters, raw.get("plugins"))
    findings += wrong
    if findings or reports is None:
        return None, list(dict.fromkeys(findings))  # what a filter believes is looked at twice
    parts["claims"] = [each.model_copy(update={"at": each.at or reports}) for each in claims]
    parts.update(head.model_dump(), report_times=reports, question=_one_line(question))
    parts.update(system=system.spec, filters=filters)
    return Experiment(**parts), []


def _section(model: type[Model], raw: Any, path: Path, findings: list[Finding]) -> Model:
    """A section of the file, as far as it is right."""
    instance, wrong = validated(model, raw, path)
    findings += wrong
    return instance or sound(model, raw, wrong, path)


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


def _entries(raw: Mapping[str, Any], findings: list[Finding]) -> list[Any]:
    given = raw.get("filters", [])
    if "filters" in raw and (not isinstance(given, list) or not given):
        findings.append(Finding(("filters",), f"{_MEANINGS['filters']}, found {found(given)}"))
        return []
    return [stated.expand_entry(each) for each in given]


def _label(entry: Any) -> str | None:
    """The label of an entry, as far as it can be told when other things about the entry are wrong."""
    if not isinstance(entry, dict):
        return None
    label = entry.get("label", entry.get("name"))
    return label if isinstance(label, str) else None


def _filter(given: Any, path: Path, system: stated.Stated, findings: list[Finding]) -> FilterSpec | None:
    if not isinstance(given, dict) or not isinstance(given.get("name"), str):
        findings.append(stated.refuse_nameless(given, path, "filter"))
        return None
    before = len(findings)
    named = _kept(
        validated(Named, {key: given[key] for key in Named.model_fields if key in given}, path), findings
    )
    name, options, at = given["name"], None, (*path, "name")
    sure = len(findings)
    believed = given.get("model")  # which `Named` refuses where it is no mapping
    believed = believed if isinstance(believed, dict) else {}
    model = stated.read_beliefs(system, believed, (*path, "model"), findings)
    kinds = stated.list_kinds(system, model) if len(findings) == sure else list(catalogue.KINDS)
    known = catalogue.available()
    if unknown := plugged.unknown(name, "filter", known.__contains__, known):
        findings.append(Finding(at, unknown))
    else:
        if len(kinds) == 1 and (refused := catalogue.refusal(name, *kinds[0])):
            findings.append(Finding(at, f"'{name}' {refused}"))
        own = {key: value for key, value in given.items() if key not in Named.model_fields}
        options = _kept(_options(name, kinds, own, path), findings)
    initial, wrong = _initial(given.get("initial") or {}, (*path, "initial"))
    findings += wrong
    if len(findings) > before or named is None or options is None:
        return None
    options = options.model_dump(mode="json")
    return FilterSpec(name=name, label=named.label or name, options=options, model=model, initial=initial)


def _options(
    name: str, kinds: Sequence[tuple[bool, bool]], own: dict[str, Any], path: Path
) -> tuple[Any, list[Finding]]:
    """A filter's options for a system of one of these kinds, or of those that it is for, that fit best."""
    takes = catalogue.takes(name)
    found = [
        validated(catalogue.options(name, *kind), own, path)
        for kind in [each for each in kinds if each in takes] or takes
    ]
    return min(found, key=lambda each: len(each[1]))


def _initial(given: Any, path: Path) -> tuple[dict[str, Any], list[Finding]]:
    initial, findings = validated(Initial, given, path)
    return (initial.moments() if initial else {}), findings


def _one_line(question: str) -> str:
    """The question as a comment can hold it."""
    return "".join(letter if letter.isprintable() else " " for letter in question).strip()


def _claims(raw: Mapping[str, Any], findings: list[Finding]) -> list[Claim]:
    """The claims, as far as they are right."""
    given = raw.get("claims", [])
    if not isinstance(given, list):
        findings.append(Finding(("claims",), f"expected a list of claims, found {found(given)}"))
        return []
    claims = []
    for index, each in enumerate(given):
        at, before = ("claims", index), len(findings)
        claim = _section(Claim, each, at, findings)
        wrong = {str(found.path[2]) for found in findings[before:] if len(found.path) > 2}
        if wrong and wrong <= APART and (misfit := claim.misfit()):
            findings.append(Finding(at, misfit))
        claims.append(claim)
    return claims


def _kept(result: tuple[Any, list[Finding]], findings: list[Finding]) -> Any:
    findings += result[1]
    return result[0]
