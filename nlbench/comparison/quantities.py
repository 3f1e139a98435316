"""Which statistics are compared: by default the RMS errors, otherwise those that were asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from nlbench.comparison.common import Common
from nlbench.comparison.side import Side
from nlbench.errors import ConfigError
from nlbench.statistics.comparisons import Quantity
from nlbench.statistics.summary import STATISTICS
from nlbench.suggestions import suggestion

ALL = "all"
DIVERGED = "diverged"


def checked(statistics: Sequence[str] | str | None) -> tuple[str, ...] | None:
    """The names asked for; None for the default. Raises `ConfigError` for unknown ones."""
    if statistics is None:
        return None
    if statistics == ALL:
        return STATISTICS
    names = (statistics,) if isinstance(statistics, str) else tuple(statistics)
    unknown = [name for name in names if name not in STATISTICS]
    if unknown:
        raise ConfigError(
            "\n".join(f"unknown statistic '{name}'{suggestion(name, STATISTICS)}" for name in unknown)
        )
    return names


def quantities(
    a: Side, b: Side, shared: Common, names: tuple[str, ...] | None, over_time: bool
) -> Iterator[Quantity]:
    """What both tables have at the common report times, and over all times if asked, but fractions of diverged runs.

    By default the RMS error, clipped for a filter that diverged in either, where errors are clipped.
    """
    times = {round(time, 9) for time in shared.times}
    coordinates = {*shared.coordinates, ALL}
    usual = {
        (label, name): "rms_clipped" if _diverged(label, a, b) and _clipped_alike(name, a, b) else "rms"
        for label in shared.labels
        for name in shared.coordinates
    }
    for row in a.tables["statistics"].itertuples():
        if row.filter not in shared.labels or row.coordinate not in coordinates or row.statistic == DIVERGED:
            continue
        if row.time == ALL:
            time: Any = ALL
            if not over_time:
                continue
        elif round(time := float(row.time), 9) not in times:
            continue
        wanted = (usual.get((row.filter, row.coordinate)),) if names is None else names
        if row.statistic not in wanted:
            continue
        if row.statistic == "rms_clipped" and not _clipped_alike(row.coordinate, a, b):
            continue
        quantity = Quantity(str(row.filter), time, str(row.coordinate), str(row.statistic))
        if b.has(quantity):
            yield quantity


def _diverged(label: str, *sides: Side) -> bool:
    return any(side.diverged(label) for side in sides)


def _clipped_alike(coordinate: str, a: Side, b: Side) -> bool:
    """Whether errors of a coordinate are capped, and at the same value."""
    return a.clips(coordinate) and a.clip[coordinate] == b.clip.get(coordinate)
