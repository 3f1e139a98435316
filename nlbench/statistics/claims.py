"""Verdicts on the orderings that an experiment claims.

`less: [a, b, c]` means a < b < c: the neighbours are compared at every time of the claim (by default all
report times), by the paired difference where there is one, otherwise as if independent (which is cautious,
since the runs are shared). All comparisons of the experiment share Holm's (1979) correction at level 5 %. A
claim is confirmed when all its comparisons are significant in the claimed direction, refuted when one is
significant in the other, and undecided otherwise; fewer than 30 runs decide nothing. The estimate shown is the
difference of the comparison that supports the claim least, with its own 95 % interval.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol, runtime_checkable

import pandas as pd

from nlbench.statistics.uncertainty import NORMAL_975, p_value

LEVEL = 0.05
LEAST_RUNS = 30  # fewer do not make a mean normal enough for a verdict
COLUMNS = ("id", "says", "verdict", "estimate", "low", "high", "n")


@runtime_checkable
class Claim(Protocol):
    """What is needed of a claim of the experiment file."""

    @property
    def id(self) -> str: ...

    @property
    def says(self) -> str: ...

    @property
    def statistic(self) -> str: ...

    @property
    def less(self) -> Sequence[str]: ...

    @property
    def at(self) -> Sequence[float]: ...

    @property
    def coordinate(self) -> str | None: ...


class Comparison(NamedTuple):
    """Statistic of the smaller minus that of the larger, as claimed."""

    difference: float
    stderr: float
    n: int

    @property
    def p(self) -> float:
        """1 where nothing can be said."""
        p = p_value(self.difference, self.stderr)
        return 1.0 if math.isnan(p) or self.n < LEAST_RUNS else p

    @property
    def against(self) -> float:
        """How far it speaks against the claim, in standard errors."""
        if math.isnan(self.difference) or math.isnan(self.stderr):
            return math.inf
        return self.difference / self.stderr if self.stderr else math.copysign(math.inf, self.difference)


def evaluate(claims: Iterable[Claim], statistics: pd.DataFrame, paired: pd.DataFrame) -> pd.DataFrame:
    """`id, says, verdict, estimate, low, high, n` of each claim, from the other two tables."""
    claims = list(claims)
    lookup = _Tables(statistics, paired)
    compared = [
        [
            lookup.compare(claim.statistic, claim.coordinate, time, a, b)
            for time in claim.at or lookup.times
            for a, b in zip(claim.less, claim.less[1:], strict=False)
        ]
        for claim in claims
    ]
    significant = iter(holm([comparison.p for comparisons in compared for comparison in comparisons]))
    rows = []
    for claim, comparisons in zip(claims, compared, strict=True):
        signs = [math.copysign(1, c.difference) if next(significant) else 0 for c in comparisons]
        verdict = "refuted" if 1 in signs else "confirmed" if signs and set(signs) == {-1} else "undecided"
        weakest = max(comparisons, key=lambda c: c.against, default=Comparison(math.nan, math.nan, 0))
        margin = NORMAL_975 * weakest.stderr
        interval = weakest.difference - margin, weakest.difference + margin
        rows.append((claim.id, claim.says, verdict, weakest.difference, *interval, weakest.n))
    return pd.DataFrame(rows, columns=COLUMNS)


def holm(p_values: list[float], level: float = LEVEL) -> list[bool]:
    """Which hypotheses are rejected when all are tested together."""
    rejected = [False] * len(p_values)
    for rank, index in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        if p_values[index] > level / (len(p_values) - rank):
            break
        rejected[index] = True
    return rejected


class _Tables:
    """Differences between two filters, looked up in the tables."""

    def __init__(self, statistics: pd.DataFrame, paired: pd.DataFrame):
        self.first_coordinate = statistics["coordinate"].iloc[0]
        self.times = list(dict.fromkeys(paired["time"]))
        self.statistics = {
            (row.filter, _time(row.time), row.coordinate, row.statistic): row
            for row in statistics.itertuples()
        }
        self.paired = {
            (row.filter_a, row.filter_b, _time(row.time), row.coordinate, row.statistic): row
            for row in paired.itertuples()
        }

    def compare(self, statistic: str, coordinate: str | None, time: float, a: str, b: str) -> Comparison:
        what = (_time(time), coordinate or self.first_coordinate, statistic)
        for sign, key in ((1, (a, b, *what)), (-1, (b, a, *what))):
            if row := self.paired.get(key):
                return Comparison(sign * row.difference, row.stderr, row.n)
        first, second = (self.statistics.get((label, *what)) for label in (a, b))
        if first is None or second is None:
            return Comparison(math.nan, math.nan, 0)
        difference = first.value - second.value
        return Comparison(difference, math.hypot(first.stderr, second.stderr), min(first.n, second.n))


def _time(time: float | str) -> float | str:
    return "all" if time == "all" else round(float(time), 9)
