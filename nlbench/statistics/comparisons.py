"""What a claim asks of the tables, taken apart into comparisons of one filter, or of two, at one time.

Every form of a claim is a *margin* that is negative where the claim holds:

    less        factor a - b                     a, b: the statistic of two neighbours in the list
    less        factor |a/A - 1| - |b/B - 1|     with agrees_with: A, B the other statistic of the same filters
    equal       |a - b| - within |b|
    below       a - below
    above       above - a
    agrees_with |a - A| - within |A|
    less_than   factor a - A

Standard errors are those of the first order in the statistics. That of a - b is the one of the paired difference where
there is one; otherwise the two count as independent, which is cautious, since the runs are shared. Two statistics
of one filter may depend on each other in either direction: their standard errors are added, which is the worst case.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from nlbench.statistics.claim import Claim
from nlbench.statistics.uncertainty import NORMAL_975, wilson


class Quantity(NamedTuple):
    """A statistic of a filter at a time."""

    filter: str
    time: float
    coordinate: str
    statistic: str


class Known(NamedTuple):
    """Its value, standard error and number of runs."""

    value: float
    stderr: float
    n: int


class Comparison(NamedTuple):
    """A margin of a claim, negative where the claim holds, with its standard error and the runs behind it."""

    margin: float
    stderr: float
    n: int


UNKNOWN = Known(math.nan, math.nan, 0)


class Term(NamedTuple):
    """A comparison before any number: what is compared, by which form, with which constants."""

    form: str
    quantities: tuple[Quantity, ...]
    constant: float

    def margin(self, values: Sequence[Any]) -> Any:
        """The margin from the values of the quantities: numbers, or arrays of them."""
        a, *others = values
        b = others[0] if others else math.nan
        match self.form:
            case "less" | "less_than":
                return self.constant * a - b
            case "closer":
                return self.constant * abs(a / others[1] - 1) - abs(b / others[2] - 1)
            case "equal" | "agrees_with":
                return abs(a - b) - self.constant * abs(b)
            case "below":
                return a - self.constant
            case _:
                return self.constant - a


def terms(claim: Claim, first_coordinate: str, times: Sequence[float]) -> Iterator[Term]:
    """The comparisons that a claim consists of; none for printed moments."""
    coordinate = claim.coordinate or ("all" if claim.statistic == "diverged" else first_coordinate)

    def quantity(label: str, time: float, statistic: str | None = None) -> Quantity:
        return Quantity(label, time, coordinate, statistic or claim.statistic)

    for time in claim.at or times:
        if claim.form in ("less", "equal"):
            for a, b in pairwise(claim.labels):
                two = (quantity(a, time), quantity(b, time))
                if claim.form == "equal":
                    yield Term("equal", two, claim.within or 0.0)
                elif claim.agrees_with:
                    others = tuple(quantity(label, time, claim.agrees_with) for label in (a, b))
                    yield Term("closer", (*two, *others), claim.factor or 1.0)
                else:
                    yield Term("less", two, claim.factor or 1.0)
            continue
        for label in claim.labels:
            own = quantity(label, time)
            if claim.below is not None:
                yield Term("below", (own,), claim.below)
            if claim.above is not None:
                yield Term("above", (own,), claim.above)
            if claim.agrees_with:
                yield Term(
                    "agrees_with", (own, quantity(label, time, claim.agrees_with)), claim.within or 0.0
                )
            if claim.less_than:
                yield Term("less_than", (own, quantity(label, time, claim.less_than)), claim.factor or 1.0)


class Tables:
    """Statistics and paired differences, looked up by what they are of."""

    def __init__(self, statistics: pd.DataFrame, paired: pd.DataFrame):
        self.first_coordinate = str(statistics["coordinate"].iloc[0])
        self.times = [float(time) for time in dict.fromkeys(paired["time"])]
        self._statistics = {
            (row.filter, _time(row.time), row.coordinate, row.statistic): Known(row.value, row.stderr, row.n)
            for row in statistics.itertuples()
        }
        self._paired = {
            (row.filter_a, row.filter_b, _time(row.time), row.coordinate, row.statistic): Known(
                row.difference, row.stderr, row.n
            )
            for row in paired.itertuples()
        }

    def known(self, quantity: Quantity) -> Known:
        """What the table of statistics says; nothing where it has no such row."""
        key = (quantity.filter, _time(quantity.time), quantity.coordinate, quantity.statistic)
        return self._statistics.get(key, UNKNOWN)

    def compare(self, term: Term) -> Comparison:
        """A comparison with its numbers."""
        found = [self.known(quantity) for quantity in term.quantities]
        if term.form in ("less", "equal") and (paired := self._difference(*term.quantities)):
            return _paired(term, paired, found[1])
        margin = float(term.margin([each.value for each in found]))
        return Comparison(margin, _stderr(term, found, margin), min(each.n for each in found))

    def _difference(self, a: Quantity, b: Quantity) -> Known | None:
        """a - b on the same runs."""
        what = (_time(a.time), a.coordinate, a.statistic)
        if row := self._paired.get((a.filter, b.filter, *what)):
            return row
        row = self._paired.get((b.filter, a.filter, *what))
        return row and Known(-row.value, row.stderr, row.n)


def _paired(term: Term, difference: Known, b: Known) -> Comparison:
    """Of the paired difference d = a - b: factor a - b = factor d + (factor - 1) b, or |d| - within |b|."""
    if term.form == "equal":
        margin = abs(difference.value) - term.constant * abs(b.value)
        return Comparison(margin, difference.stderr + term.constant * b.stderr, difference.n)
    rest = term.constant - 1.0
    if rest == 0:
        return Comparison(*difference)
    margin = term.constant * difference.value + rest * b.value
    return Comparison(margin, term.constant * difference.stderr + abs(rest) * b.stderr, difference.n)


def _stderr(term: Term, found: list[Known], margin: float) -> float:
    """The standard error of a margin of statistics that no table pairs."""
    a, *others = found
    constant = term.constant
    if term.quantities[0].statistic == "diverged":
        return _of_fractions(term, found, margin)
    match term.form:
        case "less":
            return math.hypot(constant * a.stderr, others[0].stderr)
        case "equal":
            return math.hypot(a.stderr, (1 + constant) * others[0].stderr)
        case "less_than":
            return constant * a.stderr + others[0].stderr
        case "agrees_with":
            return a.stderr + (1 + constant) * others[0].stderr
        case "closer":
            return math.hypot(constant * _of_ratio(a, others[1]), _of_ratio(others[0], others[2]))
        case _:
            return a.stderr


def _of_ratio(a: Known, b: Known) -> float:
    """Of |a/b|, with the errors of both added."""
    return (a.stderr + abs(a.value / b.value) * b.stderr) / abs(b.value) if b.value else math.nan


def _of_fractions(term: Term, found: list[Known], margin: float) -> float:
    """Of fractions of runs, which may be none: a bound p has the standard error sqrt(p (1 - p)/n) that it would have
    if it were the truth; a difference that of Wilson's limits which face each other (Newcombe 1998, method 10)."""
    if min(each.n for each in found) == 0:
        return math.nan
    if len(found) == 1:
        p = min(max(term.constant, 0.0), 1.0)
        return math.sqrt(p * (1 - p) / found[0].n)
    a, b = found
    limits = [wilson(np.asarray(each.value * each.n), each.n) for each in found]
    factor = term.constant if term.form == "less" else 1.0
    sides = [
        math.hypot(factor * (limits[0][side] - a.value), limits[1][1 - side] - b.value) / NORMAL_975
        for side in (0, 1)
    ]
    return sides[1 if margin < 0 else 0] if term.form == "less" else (1 + term.constant) * max(sides)


def _time(time: float | str) -> float | str:
    return "all" if time == "all" else round(float(time), 9)
