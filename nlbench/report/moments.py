"""Estimated and actual moments of the errors, in the layout of the tables of Culver (1969), 8.1-8.4."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import repeat
from typing import NamedTuple

import pandas as pd

from nlbench.figures.data import Data
from nlbench.report.numbers import measured, plain, scientific

FEW = 4  # filters whose blocks all stand open; of more, only the first does
WORDS = {2: "second moments", 3: "third moments"}


class Entry(NamedTuple):
    """A moment: the numbers and the names of its coordinates, its value, its standard error if it has one."""

    numbers: str
    names: str
    value: str
    stderr: str = ""


class Group(NamedTuple):
    """The moments of one kind; `note` stands in the place of entries that would say nothing."""

    caption: str
    entries: list[Entry]
    note: str = ""


class Block(NamedTuple):
    """What one filter states of its errors, and what they were over `runs`."""

    filter: str
    runs: str
    open: bool
    groups: list[Group]


class AtTime(NamedTuple):
    """The blocks of all filters at a report time; the last time stands open."""

    time: str
    open: bool
    blocks: list[Block]


class Moments(NamedTuple):
    """All blocks; `legend` numbers the coordinates."""

    legend: list[tuple[int, str]]
    times: list[AtTime]


def moments(table: pd.DataFrame, data: Data) -> Moments | None:
    """Nothing for a single coordinate, whose moments are curves in the figures."""
    coordinates = data.coordinates("mean_error")
    if len(coordinates) < 2:
        return None
    units = [data.units.get(name, "") for name in coordinates]
    legend = [
        f"{name}\u00a0({unit})" if unit else name for name, unit in zip(coordinates, units, strict=True)
    ]
    return Moments(
        list(enumerate(legend, start=1)),
        [
            AtTime(
                measured(plain(time), data.units["time"]),
                time == table["time"].iloc[-1],
                [
                    _block(rows, data, coordinates, place == 0 or len(data.filters) <= FEW)
                    for place, (_, rows) in enumerate(of_time.groupby("filter", sort=False))
                ],
            )
            for time, of_time in table.groupby("time", sort=False)
        ],
    )


def _block(rows: pd.DataFrame, data: Data, coordinates: tuple[str, ...], opened: bool) -> Block:
    first = rows.iloc[0]
    runs = f"{first['n']:,} of {data.runs:,} runs"
    return Block(first["filter"], runs, opened, list(_groups(rows, data, coordinates)))


def _groups(rows: pd.DataFrame, data: Data, coordinates: tuple[str, ...]) -> Iterator[Group]:
    """Of each order: the moments that the filter states, and those of its errors; between them the mean error."""
    label, time = rows["filter"].iloc[0], rows["time"].iloc[0]
    for order, words in WORDS.items():
        chosen = rows[rows["indices"].str.count(",") == order - 1]
        components = [tuple(int(i) - 1 for i in text.split(",")) for text in chosen["indices"]]
        estimated, actual, stderr = (list(chosen[name]) for name in ("estimated", "actual", "stderr"))
        if order == 3 and not any(estimated):
            yield Group(f"Estimated {words}", [], "all zero, as in every filter that carries none")
        else:
            yield Group(f"Estimated {words}", _entries(coordinates, components, estimated))
        if order == 2:
            single = [(i,) for i in range(len(coordinates))]
            at = [data.at(label, name, "mean_error", time) for name in coordinates]
            yield Group("Mean estimation error", _entries(coordinates, single, *zip(*at, strict=True)))
        yield Group(f"Actual {words}", _entries(coordinates, components, actual, stderr))


def _entries(
    coordinates: tuple[str, ...],
    components: Iterable[tuple[int, ...]],
    values: Iterable[float],
    stderrs: Iterable[float] | None = None,
) -> list[Entry]:
    between = "" if len(coordinates) < 10 else ","
    return [
        Entry(
            between.join(str(i + 1) for i in component),
            " · ".join(coordinates[i] for i in component),
            scientific(value),
            "" if stderr is None else f"± {scientific(stderr, 2)}",
        )
        for component, value, stderr in zip(components, values, stderrs or repeat(None), strict=False)
    ]
