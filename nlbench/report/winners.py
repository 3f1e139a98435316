"""Who wins: the filter with the smallest error at each report time, and which others it is significantly better than.

All comparisons of a statistic share Bonferroni's correction, since the winner is chosen by looking at the same numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import pandas as pd

from nlbench.figures.data import Data
from nlbench.report.numbers import listed, measured, percent, plain, uncertain

LEVEL = 0.05
WORDS = {"rms": "RMS error", "rms_clipped": "clipped RMS error"}


class Winner(NamedTuple):
    """The best filter at a time, those it beats, those on its level, and those that gave nothing.

    `gap` is how much better the reference is, as a fraction.
    """

    time: float
    coordinate: str
    statistic: str
    best: str
    value: float
    stderr: float
    beaten: tuple[str, ...]
    level: tuple[str, ...]
    failed: tuple[str, ...]
    gap: float | None
    gap_significant: bool


class Comparison(NamedTuple):
    """First filter minus second, on the same runs."""

    difference: float
    p_value: float


def winners(data: Data, statistic: str) -> list[Winner]:
    """A winner for each coordinate and report time, as far as there is one."""
    rows = data.paired[data.paired["statistic"] == statistic]
    compared = _comparisons(rows)
    filters = [label for label in data.filters if label != data.reference]
    level = LEVEL / max(len(rows), 1)
    found = []
    for coordinate in data.coordinates(statistic):
        for time in sorted(set(rows["time"])):
            found.append(_winner(data, compared, level, time, coordinate, statistic, filters))
    return [winner for winner in found if winner is not None]


def _winner(
    data: Data,
    compared: dict[tuple[str, str, float, str], Comparison],
    level: float,
    time: float,
    coordinate: str,
    statistic: str,
    filters: list[str],
) -> Winner | None:
    points = {label: data.at(label, coordinate, statistic, time) for label in data.filters}
    alive = [label for label in filters if math.isfinite(points[label][0])]
    if not alive:
        return None
    best = min(alive, key=lambda label: points[label][0])
    value, stderr = points[best]
    unknown = Comparison(math.nan, math.nan)
    against = {label: compared.get((best, label, time, coordinate), unknown) for label in data.filters}
    beaten = tuple(x for x in alive if against[x].difference < 0 and against[x].p_value <= level)
    gap, significant = None, False
    if data.reference and value > 0:
        gap = 1 - points[data.reference][0] / value
        significant = against[data.reference].p_value <= level
    return Winner(
        time, coordinate, statistic, best, value, stderr, beaten,
        level=tuple(x for x in alive if x != best and x not in beaten),
        failed=tuple(x for x in filters if x not in alive),
        gap=gap, gap_significant=significant,
    )  # fmt: skip


def _comparisons(rows: pd.DataFrame) -> dict[tuple[str, str, float, str], Comparison]:
    """Every comparison, in both directions."""
    found = {}
    for row in rows.itertuples():
        found[row.filter_a, row.filter_b, row.time, row.coordinate] = Comparison(row.difference, row.p_value)
        found[row.filter_b, row.filter_a, row.time, row.coordinate] = Comparison(-row.difference, row.p_value)
    return found


def sentences(winner: Winner, data: Data) -> str:
    """The winner in words."""
    time = measured(plain(winner.time), data.units["time"])
    value = uncertain(winner.value, winner.stderr)
    words = (
        f"At t = {time}, {winner.best} has the smallest {WORDS[winner.statistic]} of {winner.coordinate}: "
    )
    words += f"{measured(value, data.units.get(winner.coordinate, ''))}."
    if winner.beaten:
        words += f" That is significantly less than {listed(winner.beaten)}."
    if winner.level:
        words += f" It cannot be told apart from {listed(winner.level)}."
    if winner.failed:
        words += f" {listed(winner.failed)} gave no usable estimate."
    if winner.gap is not None and winner.gap > 0:
        sure = "" if winner.gap_significant else ", which is not significant"
        words += f" The {data.reference} reference is still {percent(winner.gap)} % better{sure}."
    return words
