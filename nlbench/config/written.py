"""The times that an experiment file writes, gathered from wherever they stand in it."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from typing import Any

from nlbench.config.claim import Claim
from nlbench.config.explain import Finding, sound, validated
from nlbench.config.places import Path, dotted
from nlbench.config.schema import Head, TimeSpec
from nlbench.config.stated import Stated, find_interval, list_kinds
from nlbench.config.times import CLOSE, Given, Time, is_time


def gather(
    raw: Mapping[str, Any],
    head: Head,
    entries: Sequence[Any],
    claims: Sequence[Claim],
    system: Stated,
    truth: dict[str, Any],
    findings: list[Finding],
) -> Given:
    """Gather the times that are right; what is wrong with those of the section `time` is added to the findings.

    entries: of `filters`, as the file has them.
    """
    written = _sections_own(raw.get("time", {}), findings)
    kinds = list_kinds(system, truth)
    discrete, continuous = (all(each) for each in zip(*kinds, strict=True))
    steps = _steps(entries, {each.path for each in findings})
    if discrete:
        findings += _refuse_steps(written.pop("step", None), steps)
        steps = []
    interval = find_interval(system, truth)
    usual = system.parameters.get("interval")
    usual = usual if is_time(usual) else interval.value if interval else None
    return Given(
        **written,
        reports=_reports(head) if "report_times" in raw else _claimed(claims),
        steps=steps,
        interval=interval,
        usual=usual,
        discrete=discrete,
        continuous=continuous,
    )


def report_times(
    raw: Mapping[str, Any], given: Given, time: TimeSpec | None, wrong: Container[Path]
) -> list[float] | None:
    """List the report times, ascending: unless the file says otherwise, the end and the times that claims name.

    None where not all are known.
    """
    times = [each.value for each in given.reports]
    if "report_times" in raw:
        whole = ("report_times",) not in wrong and len(times) == len(raw["report_times"])
        return sorted(times) if whole else None
    end = given.end.value if given.end else time.end if time else None
    if end is None:
        return None
    return sorted([*(each for each in times if not math.isclose(each, end, rel_tol=CLOSE)), end])


def _sections_own(given: Any, findings: list[Finding]) -> dict[str, Time]:
    """Times of the section `time`, by their keys."""
    keys = tuple(TimeSpec.model_fields)
    whole = {**dict.fromkeys(keys, 1.0), **given} if isinstance(given, dict) else given
    _, wrong = validated(TimeSpec, whole, ("time",))
    findings += wrong
    right = sound(TimeSpec, given, wrong, ("time",)).model_dump(warnings=False)
    return {key: Time(right[key], f"time.{key}", ("time", key)) for key in keys if is_time(right[key])}


def _steps(entries: Sequence[Any], wrong: Container[Path]) -> list[Time]:
    """Steps that filters have of their own."""
    places: dict[Path, Any] = {
        ("filters", index, "step"): entry.get("step")
        for index, entry in enumerate(entries)
        if isinstance(entry, dict)
    }
    return [
        Time(step, dotted(path), path) for path, step in places.items() if path not in wrong and is_time(step)
    ]


def _refuse_steps(step: Time | None, own: Sequence[Time]) -> list[Finding]:
    """Say that where time is discrete a step is 1, and filters do not choose it."""
    findings = []
    if step and step.value != 1:
        message = f"time is discrete, so a step is 1, found {step.value:g}; leave it out"
        findings.append(Finding(step.path, message))
    message = "time is discrete, nothing is integrated; leave the step out"
    return findings + [Finding(each.path, message) for each in own]


def _reports(head: Head) -> list[Time]:
    """Report times that the file writes."""
    return [
        Time(each, "the report time", ("report_times", index))
        for index, each in enumerate(head.report_times or [])
        if each is not None
    ]


def _claimed(claims: Sequence[Claim]) -> list[Time]:
    """Times that claims name, each once."""
    named: dict[float, Time] = {}
    for index, claim in enumerate(claims):
        for position, each in enumerate(claim.at or []):
            if each is not None:
                named.setdefault(each, Time(each, "the time", ("claims", index, "at", position)))
    return list(named.values())
