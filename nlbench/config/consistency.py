"""Checks of the sections of an experiment against each other: times, labels, claims, traced runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from nlbench.config.claim import FORMS, Claim
from nlbench.config.explain import LARGEST, Finding
from nlbench.config.schema import FilterSpec, Head, MonteCarlo, Source, SystemSpec, TimeSpec
from nlbench.suggestions import suggestion

MOST_OUTPUTS = 100_000
MOST_STEPS = 10**9
_TOO_MANY_STEPS = f"more than {MOST_STEPS:,} steps; take a longer step"


def default_times(system: SystemSpec, given: dict[str, Any], discrete: bool) -> dict[str, float]:
    """Twenty measurements, a statistic at each and ten steps between, unless the file says otherwise; in discrete time
    steps are given, and where no interval is, there is a statistic at each.
    """
    interval = system.parameters.get("interval") or given.get("output")
    end = given.get("end", 1.0)
    if not interval and isinstance(end, (int, float)) and abs(end) <= LARGEST:
        interval = 1 if discrete else end / 20
    if not isinstance(interval, (int, float)) or not 0 < interval <= LARGEST:
        return {}
    return {"end": 20 * interval, "output": interval, "step": 1 if discrete else interval / 10}


def report_times(head: Head | None, time: TimeSpec | None) -> list[float] | None:
    """The report times in ascending order; the end unless the file says otherwise; None if not yet known."""
    if head is None or time is None:
        return None
    return sorted(head.report_times) if head.report_times else [time.end]


def times(
    time: TimeSpec | None,
    reports: Sequence[float] | None,
    system: SystemSpec | None,
    filters: Sequence[FilterSpec | None],
    truth: dict[str, Any],
) -> list[Finding]:
    """Everything that must fall on the grid of steps, or of outputs, does."""
    if time is None:
        return []
    findings = [
        *_multiple(("time", "output"), time.output, "time.step", time.step),
        *_multiple(("time", "end"), time.end, "time.output", time.output),
    ]
    if time.end / time.output > MOST_OUTPUTS:
        findings.append(
            Finding(("time", "output"), f"more than {MOST_OUTPUTS:,} output times; take a longer spacing")
        )
    if time.end / time.step > MOST_STEPS:
        findings.append(Finding(("time", "step"), _TOO_MANY_STEPS))
    reports = reports or []
    for index, each in enumerate(reports):
        at = ("report_times", index)
        if each > time.end * (1 + 1e-9):
            findings.append(Finding(at, f"the report time {each:g} is after time.end = {time.end:g}"))
        elif index and each == reports[index - 1]:
            findings.append(Finding(at, f"the report time {each:g} stands twice"))
        elif each != time.end:
            findings += _multiple(at, each, "time.output", time.output)
    for path, holder in ((("system",), system.parameters if system else {}), (("truth",), truth)):
        interval = holder.get("interval")
        if isinstance(interval, (int, float)):
            findings += _multiple((*path, "interval"), interval, "time.step", time.step)
            if holder.get("measurement") != "none" and interval > time.end * (1 + 1e-9):
                message = f"{interval:g} is longer than time.end = {time.end:g}, so nothing would be measured"
                findings.append(Finding((*path, "interval"), f"{message}; measurement: none says so"))
    for index, spec in enumerate(filters):
        step = spec.options.get("step") if spec else None
        if step is None:
            continue
        findings += _multiple(("time", "output"), time.output, f"filters.{index}.step", step)
        if time.end / step > MOST_STEPS:
            findings.append(Finding(("filters", index, "step"), _TOO_MANY_STEPS))
    return findings


def steps(filters: Sequence[FilterSpec | None]) -> list[Finding]:
    """Where time is discrete, filters do not choose the step."""
    return [
        Finding(("filters", index, "step"), "time is discrete, nothing is integrated; leave the step out")
        for index, spec in enumerate(filters)
        if spec and spec.options.get("step") is not None
    ]


def labels(labels: Sequence[str | None], filters: int) -> list[Finding]:
    """No two filters share a label, and none takes the reference's, which follows theirs in `labels`."""
    findings = []
    first: dict[str, int] = {}
    for index, label in enumerate(labels[:filters]):
        if label is None:
            continue
        other = (
            f"filters.{first[label]}"
            if label in first
            else "the reference"
            if label in labels[filters:]
            else ""
        )
        if other:
            message = f"'{label}' is already the label of {other}; give this one a label of its own"
            findings.append(Finding(("filters", index, "label"), message))
        first.setdefault(label, index)
    return findings


def claims(
    claims: Sequence[Claim | None],
    labels: Sequence[str | None],
    reports: Sequence[float] | None,
    source: Source | None,
) -> list[Finding]:
    """Claims name filters, times and figures of this experiment; labels are judged only when every one is known."""
    findings = []
    ids: dict[str, int] = {}
    known = [label for label in labels if label]
    for index, each in enumerate(claims):
        if each is None:
            continue
        if each.id in ids:
            findings.append(
                Finding(("claims", index, "id"), f"'{each.id}' is already the id of claims.{ids[each.id]}")
            )
        ids.setdefault(each.id, index)
        form = next(key for key in FORMS if getattr(each, key) is not None)
        for position, label in enumerate(each.labels):
            at = ("claims", index, form, position)
            if known and None not in labels and label not in known:
                findings.append(Finding(at, f"no filter is labelled '{label}'{suggestion(label, known)}"))
            elif label in each.labels[:position]:
                findings.append(Finding(at, f"'{label}' stands twice in this claim"))
        numbers = [*source.figures, *source.tables] if source else each.figures or []
        for position, number in enumerate(each.figures or []):
            if number not in numbers:
                of = f"source ({', '.join(numbers)})" if numbers else "source, which names none"
                message = f"'{number}' is not one of the figures and tables of {of}"
                findings.append(Finding(("claims", index, "figures", position), message))
        for position, time in enumerate(each.at):
            if reports is not None and not any(
                math.isclose(time, report, rel_tol=1e-9) for report in reports
            ):
                listed = ", ".join(f"{report:g}" for report in reports[:8]) + (
                    ", ..." if len(reports) > 8 else ""
                )
                at = ("claims", index, "at", position)
                findings.append(Finding(at, f"{time:g} is not one of the report_times ({listed})"))
    return findings


def traces(head: Head | None, monte_carlo: MonteCarlo | None) -> list[Finding]:
    """Traced runs are runs of this experiment, each named once."""
    findings = []
    numbers = head.traces if head else []
    for index, number in enumerate(numbers):
        at = ("traces", index)
        if monte_carlo and number >= monte_carlo.runs:
            findings.append(
                Finding(at, f"there is no run {number:,}; they are 0 to {monte_carlo.runs - 1:,}")
            )
        elif number in numbers[:index]:
            findings.append(Finding(at, f"run {number:,} stands twice"))
    return findings


def _multiple(path: tuple[str | int, ...], value: float, unit_name: str, unit: float) -> list[Finding]:
    ratio = value / unit
    if ratio > 0.5 and abs(ratio - round(ratio)) <= 1e-9 * max(1.0, ratio):
        return []
    below = math.floor(ratio) * unit
    nearest = f"{below:.10g} or {below + unit:.10g}" if below > 0 else f"{unit:.10g}"
    return [Finding(path, f"{value:g} is not a multiple of {unit_name} = {unit:g}; nearest: {nearest}")]
