"""Two runs, compared: every statistic that both have, tested against a margin with one Holm correction for all."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from nlbench.comparison.change import ANY, LEAST_RUNS, Measured, measured
from nlbench.comparison.common import Common, common
from nlbench.comparison.fractions import diverged
from nlbench.comparison.quantities import ALL, DIVERGED, checked, quantities
from nlbench.comparison.side import Side, opened
from nlbench.comparison.table import Asked, table
from nlbench.comparison.verdicts import EITHER_WAY, FAILING, missing
from nlbench.errors import ConfigError, NothingCompared
from nlbench.results.results import Results
from nlbench.statistics.comparisons import Quantity


class Compared(NamedTuple):
    """Both runs, the table of `nlbench.compare`, how many tests share Holm's correction, and what else to know.

    identical: whether both have the same tables of statistics, to the last bit.
    """

    a: Side
    b: Side
    asked: Asked
    table: pd.DataFrame
    tests: int
    notes: tuple[str, ...]
    identical: bool

    def failing(self, two_sided: bool = False) -> pd.DataFrame:
        """The comparisons that fail a gate."""
        return self.table[self.table["verdict"].isin(EITHER_WAY if two_sided else FAILING)]


def compared(a: Results | str | Path, b: Results | str | Path, asked: Asked) -> Compared:
    """Raises `ConfigError`, `EnvironmentFault`, `DamagedResults` and `NothingCompared`."""
    _valid(asked)
    return compared_sides(opened(a), opened(b), asked)


def compared_sides(first: Side, second: Side, asked: Asked) -> Compared:
    """Of runs that were read. Raises `ConfigError` and `NothingCompared`."""
    names = _valid(asked)
    shared = common(first, second)
    rows = list(_measured(first, second, shared, names, asked.statistics == ALL))
    tested = [row for row in rows if row.testable and not missing(row)]
    identical = first.checksums == second.checksums
    # Fractions without any diverged run are the same whatever the number of runs: they alone are no comparison.
    said = tested or any(map(missing, rows)) or (rows and all(row.same for row in rows))
    if not (identical or said):
        what = "all statistics" if names is None else ", ".join(names)
        raise NothingCompared(
            f"nothing was compared: {what} of {', '.join(shared.labels)} at t = "
            f"{', '.join(f'{time:g}' for time in shared.times)} are in both runs only of fewer than {LEAST_RUNS} runs, "
            "or not at all"
        )
    notes = (*shared.notes, *_lost_in_both(first, second, shared))
    return Compared(first, second, asked, table(rows, tested, asked), len(tested), notes, identical)


def _valid(asked: Asked) -> tuple[str, ...] | None:
    """The names of the statistics. Raises `ConfigError` with all that is wrong."""
    problems = []
    if not 0 <= asked.margin < math.inf:
        problems.append(f"margin: expected a number from 0, got {asked.margin:g}")
    if not 0 < asked.alpha < 1:
        problems.append(f"alpha: expected a number between 0 and 1, got {asked.alpha:g}")
    try:
        names = checked(asked.statistics)
    except ConfigError as error:
        problems += [str(problem) for problem in error.problems]
    if problems:
        raise ConfigError("\n".join(problems))
    return names


def _measured(
    a: Side, b: Side, shared: Common, names: tuple[str, ...] | None, over_time: bool
) -> Iterator[Measured]:
    """All comparisons; a filter that failed altogether has one, in its fraction of diverged runs."""
    fallen = {label: (a.failed(label), b.failed(label)) for label in shared.labels}
    for label in shared.labels:
        if any(fallen[label]):
            if not all(fallen[label]):
                yield _fallen(a, b, label, fallen[label])
        elif names is None or DIVERGED in names:
            yield diverged(a, b, label, shared.times)
    for quantity in quantities(a, b, shared, names, over_time):
        if not any(fallen[quantity.filter]):
            row = measured(a, b, quantity)
            if math.isfinite(row.a) or math.isfinite(row.b):
                yield row


def _fallen(a: Side, b: Side, label: str, which: tuple[bool, bool]) -> Measured:
    """Of a filter that has no number at all on one side."""
    lost = a.diverged(label) / a.runs, b.diverged(label) / b.runs
    word = "recovered" if which[0] else "FAILED"
    return Measured(Quantity(label, ANY, ALL, DIVERGED), *lost, a.runs, b.runs, False, None, word=word)


def _lost_in_both(a: Side, b: Side, shared: Common) -> Iterator[str]:
    both = [label for label in shared.labels if a.failed(label) and b.failed(label)]
    if both:
        yield f"failed in both, so not compared: {', '.join(both)}"
