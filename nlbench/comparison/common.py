"""What two runs have in common, what only one of them has, and how they were made differently."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from nlbench.comparison.side import Side
from nlbench.config.schema import READ
from nlbench.errors import NothingCompared

# Of a resolved experiment: what is told elsewhere, or decides nothing that is compared.
UNTOLD = {
    *READ,
    "experiment",
    "filters",
    "report_times",
    "monte_carlo",
    "engine",
    "limits",
    "bounds",
    "scores",
}


class Common(NamedTuple):
    """Filters, times and coordinates (with the norms) that both have, and notes on everything else."""

    labels: tuple[str, ...]
    times: tuple[float, ...]
    coordinates: tuple[str, ...]
    notes: tuple[str, ...]


def common(a: Side, b: Side) -> Common:
    """Raises `NothingCompared`, saying what each has, where they share no filter, no time or no coordinate."""
    labels, label_notes = _shared("filters", a.labels, b.labels)
    times, time_notes = _shared("report times", a.report_times, b.report_times)
    coordinates, coordinate_notes = _shared("coordinates", list(a.units), list(b.units))
    units = {name: (a.units[name], b.units[name]) for name in coordinates}
    other = [
        f"unit of {name}: {first or 'none'} in A, {second or 'none'} in B; it is not compared"
        for name, (first, second) in units.items()
        if first != second
    ]
    coordinates = tuple(name for name, (first, second) in units.items() if first == second)
    if not (labels and times and coordinates):
        raise NothingCompared("\n".join(["nothing in common", *_inventory("A", a), *_inventory("B", b)]))
    notes = [*_made(a, b), *label_notes, *time_notes, *coordinate_notes, *other]
    return Common(labels, times, coordinates, tuple(notes))


def _shared(what: str, a: Sequence[Any], b: Sequence[Any]) -> tuple[tuple[Any, ...], list[str]]:
    """In the order of `a`; and what only one of them has."""
    notes = [
        f"{what} in {side} only: {', '.join(map(_plain, missing))}"
        for side, missing in (("A", [x for x in a if x not in b]), ("B", [x for x in b if x not in a]))
        if missing
    ]
    return tuple(x for x in a if x in b), notes


def _inventory(name: str, side: Side) -> Iterable[str]:
    yield f"{name} {side.path}: {side.experiment.experiment}"
    yield f"    filters: {', '.join(side.labels)}"
    yield f"    report times: {', '.join(map(_plain, side.report_times))}"
    yield f"    coordinates: {', '.join(f'{k} ({unit})' if unit else k for k, unit in side.units.items())}"


def _made(a: Side, b: Side) -> Iterable[str]:
    """How the runs differ in what was asked, and in what computed it."""
    first, second = a.experiment, b.experiment
    if first.experiment != second.experiment:
        yield f"experiment: {first.experiment} in A, {second.experiment} in B"
    mine, theirs = first.resolved(), second.resolved()
    flat = [_flat({k: v for k, v in each.items() if k not in UNTOLD}) for each in (mine, theirs)]
    yield from _changes(*flat)
    specs = [
        {spec["label"]: _flat({k: v for k, v in spec.items() if k != "label"}) for spec in each["filters"]}
        for each in (mine, theirs)
    ]
    for label in specs[0]:
        if label in specs[1]:
            yield from (f"filter {label}: {line}" for line in _changes(specs[0][label], specs[1][label]))
    yield from _changes(
        *({f"engine.{k}": each["engine"][k] for k in ("block", "precision")} for each in (mine, theirs))
    )
    manifests = a.manifest, b.manifest
    yield from _changes(*({"commit": each.get("commit")} for each in manifests))
    yield from _changes(*(each.get("versions", {}) for each in manifests))
    # The version of jaxlib is among the versions.
    yield from _changes(
        *({k: v for k, v in each.get("fingerprint", {}).items() if k != "jaxlib"} for each in manifests)
    )


def _changes(a: dict[str, Any], b: dict[str, Any]) -> Iterable[str]:
    for key in dict.fromkeys((*a, *b)):
        if a.get(key) != b.get(key):
            yield f"{key}: {_plain(a.get(key))} in A, {_plain(b.get(key))} in B"


def _flat(values: dict[str, Any], head: str = "") -> dict[str, Any]:
    """Nested keys as `system.interval`."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{head}{key}.") if isinstance(value, dict) else {f"{head}{key}": value}
    return flat


def _plain(value: Any) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
