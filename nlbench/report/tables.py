"""The tables of the report: what stands in each cell, and by what a column is sorted."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import pandas as pd

from nlbench.figures.data import Data
from nlbench.report.numbers import listed, measured, percent, plain, ranged, share, uncertain
from nlbench.report.winners import WORDS, Winner
from nlbench.results.reasons import left_out

LONG = 30  # letters
VERDICTS = {"confirmed": "✓ confirmed", "refuted": "✗ refuted", "undecided": "? undecided"}
COST = {
    "filter": "filter",
    "ns_per_step": "time per run and step (ns)",
    "compile_seconds": "time to compile (s)",
    "operations_per_step": "operations per step",
    "operations_per_update": "operations per update",
}


class Cell(NamedTuple):
    """Text, the value to sort by, classes for the style sheet, and where the text leads if it is a link."""

    text: str
    key: float | str
    kind: str = ""
    address: str = ""


class Table(NamedTuple):
    """A table with its caption; the first cell of a row is its heading."""

    name: str
    caption: str
    columns: list[str]
    rows: list[list[Cell]]


def name(text: str) -> Cell:
    """A cell of a name, which stays on one line unless it is long."""
    return Cell(text, text, "name" if len(text) <= LONG else "long")


def prose(text: str) -> Cell:
    """A cell of words that needs some width."""
    return Cell(text, text, "prose")


def number(text: str, key: float) -> Cell:
    """A cell of a number; what is not a number sorts last."""
    return Cell(text, "" if math.isnan(key) else float(key), "number")


def errors(data: Data, statistic: str, times: Iterable[float]) -> list[Table]:
    """For each coordinate, the error of every filter at the report times, with standard errors."""
    times = list(times)
    return [
        Table(
            f"{statistic}-{coordinate}",
            _caption(statistic, coordinate, data),
            ["filter", *(f"at {_at(time, data)}" for time in times)],
            [[name(label), *_errors(data, label, coordinate, statistic, times)] for label in data.filters],
        )
        for coordinate in data.coordinates(statistic)
    ]


def _errors(data: Data, label: str, coordinate: str, statistic: str, times: list[float]) -> list[Cell]:
    points = [data.at(label, coordinate, statistic, time) for time in times]
    return [number(uncertain(value, stderr), value) for value, stderr in points]


def best(found: list[Winner], data: Data) -> Table:
    """The winners at all report times."""
    statistic = WORDS[found[0].statistic] if found else "error"
    rows = [
        [
            Cell(f"{winner.coordinate} at {_at(winner.time, data)}", winner.time),
            name(winner.best),
            prose(listed(winner.beaten) or "–"),
            prose(listed(winner.level + tuple(f"{each} (failed)" for each in winner.failed)) or "–"),
        ]
        for winner in found
    ]
    heads = ["what", "smallest", "significantly larger", "not told apart"]
    return Table("best", f"Smallest {statistic} at each report time, without the reference", heads, rows)


def divergence(data: Data) -> Table:
    """How many runs of each filter diverged, and how often its guard fired."""
    rows = []
    for row in data.divergence.to_dict("records"):
        fraction = share(row["fraction"], row["low"], row["high"])
        guarded = f"{row['guarded']:,.0f}" if row["guarded"] else "–"
        if row.get("guarded_fraction", 0) > 0:
            guarded += f" ({percent(row['guarded_fraction'])}\u00a0%)"
        kind = "bad" if row["diverged"] else ""
        rows.append(
            [
                name(row["filter"]),
                number(f"{row['diverged']:,.0f} of {row['n']:,.0f}", row["diverged"])._replace(
                    kind=f"number {kind}"
                ),
                number(fraction, row["fraction"]),
                number(plain(row["first_time_median"]), row["first_time_median"]),
                number(guarded, row["guarded"]),
            ]
        )
    heads = ["filter", "diverged runs", "fraction [95 % interval]", "median time", "guarded updates"]
    return Table("divergence", "Diverged runs and guarded updates", heads, rows)


def consistency(data: Data, times: Iterable[float]) -> Table | None:
    """NEES of every filter at the report times, and NIS over the whole run; nothing of a run that has neither."""
    if data.consistency is None or not len(data.consistency):
        return None
    table = data.consistency
    columns = [("nees", repr(float(time)), f"NEES at {_at(time, data)}") for time in times]
    columns.append(("nis", "all", "NIS of all measurements"))
    found = {(row["filter"], row["score"], row["time"]): row for row in table.to_dict("records")}
    there = [column for column in columns if any((label, *column[:2]) in found for label in data.filters)]
    dof = {score: int(rows["dof"].iloc[0]) for score, rows in table.groupby("score")}
    saved = data.saved("left_out")
    omitted = {} if saved is None else {(row["filter"], row["time"]): row for row in saved.to_dict("records")}
    rows = [
        [
            name(label),
            *(_consistency(found.get((label, *at)), omitted.get((label, at[1]))) for *at, _ in there),
        ]
        for label in data.filters
    ]
    right = listed([f"{score.upper()} {dof[score]}" for score in ("nees", "nis") if score in dof])
    caption = (
        f"Squared errors and residuals in what the filters state of them, ± standard error; right is {right}"
    )
    return Table("consistency", caption, ["filter", *(words for *_, words in there)], rows)


def _consistency(row: dict[str, Any] | None, omitted: dict[str, Any] | None) -> Cell:
    """A mean, and on which side of its bounds it lies if it has some and is not within them; omitted: a row of the
    table `left_out`."""
    if row is None or math.isnan(row["value"]):
        return number("–", math.nan)
    cell = number(uncertain(row["value"], row["stderr"]), row["value"])
    if pd.isna(row["consistent"]):
        words = f"; left out: {left_out(omitted)}" if omitted and row["score"] == "nis" else ""
        return cell._replace(text=f"{cell.text}, selected{words}")
    if row["consistent"]:
        return cell._replace(text=f"{cell.text}, consistent")
    words = "overconfident" if row["value"] > row["high"] else "too cautious"
    return cell._replace(text=f"{cell.text}, {words}")


def claims(table: pd.DataFrame) -> Table:
    """The verdict on each claim."""
    rows = []
    for row in table.to_dict("records"):
        rows.append(
            [
                name(row["id"]),
                Cell(
                    VERDICTS.get(row["verdict"], row["verdict"]), row["verdict"], f"verdict {row['verdict']}"
                ),
                prose(row["says"]),
                name(row["whose"]),
                prose(row["where"] or "–"),
                number(ranged(row["estimate"], row["low"], row["high"]), row["estimate"]),
                number(f"{row['n']:,.0f}", row["n"]),
            ]
        )
    heads = ["claim", "verdict", "in words", "whose", "where", "weakest margin [95 % interval]", "runs"]
    return Table("claims", "Claims of the experiment file, tested on common random numbers", heads, rows)


def sets(table: pd.DataFrame, source_runs: int | None) -> Table:
    """How often sets of few of the runs show each claim."""
    sizes = sorted(set(table["runs"]))
    heads = [f"sets of {size:,}{' (as the source)' * (size == source_runs)}" for size in sizes]
    found = {(row["id"], row["runs"]): row for row in table.to_dict("records")}
    rows = [
        [name(claim), *(_share(found.get((claim, size))) for size in sizes)]
        for claim in dict.fromkeys(table["id"])
    ]
    return Table("sets", "How often sets of so few runs show each claim", ["claim", *heads], rows)


def _share(row: dict[str, Any] | None) -> Cell:
    if row is None:
        return number("–", math.nan)
    return number(f"seen in {share(row['share'], row['low'], row['high'])}", row["share"])


def cost(table: pd.DataFrame) -> Table:
    """What each filter costs, in the columns that the run saved."""
    columns = list(table.columns)
    rows = [
        [
            name(row[column]) if isinstance(row[column], str) else number(plain(row[column], 3), row[column])
            for column in columns
        ]
        for row in table.to_dict("records")
    ]
    return Table(
        "cost",
        "Cost of each filter on one core",
        [COST.get(column, column.replace("_", " ")) for column in columns],
        rows,
    )


def _caption(statistic: str, coordinate: str, data: Data) -> str:
    unit = data.units.get(coordinate, "")
    words = f"{WORDS[statistic]} of {coordinate}{unit and f' ({unit})'} ± standard error, {data.runs:,} runs"
    return words[0].upper() + words[1:]


def _at(time: float, data: Data) -> str:
    return measured(plain(time), data.units["time"])
