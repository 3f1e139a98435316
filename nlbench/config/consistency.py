"""Checks of the sections of an experiment against each other: labels, claims, traced runs.

What is checked may lack what is wrong by itself, as `explain.sound` leaves it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from nlbench.config.claim import FORMS, Claim
from nlbench.config.explain import Finding
from nlbench.config.schema import Source
from nlbench.suggestions import suggestion


def labels(labels: Sequence[str | None], filters: int) -> list[Finding]:
    """No two filters share a label, whatever its capitals, and none takes the reference's, which follows theirs."""
    findings = []
    first = {each.casefold(): (each, "the reference") for each in labels[filters:] if each}
    for index, label in enumerate(labels[:filters]):
        if label is None:
            continue
        here = f"filters.{index}"
        other, of = first.setdefault(label.casefold(), (label, here))
        if of != here:
            message = f"{_taken(label, other, 'label', of)}; give this one a label of its own"
            findings.append(Finding(("filters", index, "label"), message))
    return findings


def _taken(name: str, other: str, what: str, of: str) -> str:
    """What is wrong with a name that another one equals, but perhaps for capitals."""
    if name == other:
        return f"'{name}' is already the {what} of {of}"
    return f"'{name}' differs in capitals only from '{other}', the {what} of {of}"


def claims(
    claims: Sequence[Claim],
    labels: Sequence[str | None],
    reports: Sequence[float] | None,
    source: Source | None,
) -> list[Finding]:
    """Claims name filters, times and figures of this experiment; labels are judged only when every one is known.

    reports: None where they are not known.
    """
    findings = []
    ids: dict[str, int] = {}
    known = [label for label in labels if label]
    for index, each in enumerate(claims):
        before = ids.setdefault(each.id.casefold(), index) if each.id else index
        if before != index:
            message = _taken(each.id, claims[before].id, "id", f"claims.{before}")
            findings.append(Finding(("claims", index, "id"), message))
        form = next((key for key in FORMS if getattr(each, key) is not None), "")
        for position, label in enumerate(each.labels):
            at = ("claims", index, form, position)
            if not label:
                continue
            if known and None not in labels and label not in known:
                findings.append(Finding(at, f"no filter is labelled '{label}'{suggestion(label, known)}"))
            elif label in each.labels[:position]:
                findings.append(Finding(at, f"'{label}' stands twice in this claim"))
        numbers = None if source is None else [*source.figures, *source.tables]
        for position, number in enumerate(each.figures or []):
            if numbers is not None and number is not None and number not in numbers:
                of = f"source ({', '.join(numbers)})" if numbers else "source, which names none"
                message = f"'{number}' is not one of the figures and tables of {of}"
                findings.append(Finding(("claims", index, "figures", position), message))
        for position, time in enumerate(each.at or []):
            if reports is None or time is None:
                continue
            if not any(math.isclose(time, report, rel_tol=1e-9) for report in reports):
                listed = ", ".join(f"{report:g}" for report in reports[:8])
                more = ", ..." if len(reports) > 8 else ""
                at = ("claims", index, "at", position)
                findings.append(Finding(at, f"{time:g} is not one of the report_times ({listed}{more})"))
    return findings


def traces(numbers: Sequence[int | None], runs: int | None) -> list[Finding]:
    """Traced runs are runs of this experiment, each named once."""
    findings = []
    for index, number in enumerate(numbers):
        at = ("traces", index)
        if number is None:
            continue
        if runs is not None and number >= runs:
            findings.append(Finding(at, f"there is no run {number:,}; they are 0 to {runs - 1:,}"))
        elif number in numbers[:index]:
            findings.append(Finding(at, f"run {number:,} stands twice"))
    return findings
