"""The change of one statistic from A to B, tested on the same runs where there are such, otherwise as independent.

Of errors (rms, rms_clipped, rms_run_mean, median_error) the logarithm of the ratio B/A is tested, of other statistics,
which may have either sign, the relative difference (B - A)/|A|. Where A is 0 nothing is relative to it: the difference
itself is tested, against no margin.

The runs are paired by their numbers where the seeds agree. Two runs of one number saw the same truth and noise; were
the problems different, their random numbers would still be the same, and different pairs are independent in any case,
which is all that a paired test needs. Otherwise, and for statistics of which nothing is kept run by run, the standard
errors of both are combined (Welch 1947): with the seeds alike that is cautious, since runs that share their truth vary
together.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from nlbench.comparison.per_run import influences
from nlbench.comparison.side import Side
from nlbench.comparison.significance import (
    Change,
    effective_degrees,
    satterthwaite,
    standard_error,
)
from nlbench.statistics.comparisons import Quantity

SIZES = ("rms", "rms_clipped", "rms_run_mean", "median_error")  # compared by their ratios
ROUNDING = 1e-9  # relative: what another order of summation or another processor changes, and more
ANY: Any = "any"  # in place of a time: at any report time
LEAST_RUNS = 30  # fewer do not make a mean normal enough, as for claims


class Measured(NamedTuple):
    """Values of both runs over n_a and n_b runs; `change` is None where an exact test gave `p`.

    same: the runs are the same, but for rounding, so that there is nothing to test. word: a verdict that needs no test.
    """

    quantity: Quantity
    a: float
    b: float
    n_a: int
    n_b: int
    paired: bool
    change: Change | None
    p: float = math.nan
    same: bool = False
    word: str = ""

    @property
    def by_ratio(self) -> bool:
        """Whether the change is that of a logarithm."""
        return self.quantity.statistic in SIZES

    @property
    def testable(self) -> bool:
        """Whether there are values on both sides, of enough runs, and their standard errors are known."""
        known = self.change is None or (
            not math.isnan(self.change.stderr)
            and self.change.degrees > 0
            and not math.isnan(self.change.effect)
        )
        return known and not self.same and min(self.n_a, self.n_b) >= LEAST_RUNS

    @property
    def from_zero(self) -> bool:
        """Whether the change is the difference itself."""
        return _from_zero(self.quantity, self.a, self.b)

    def ratio(self, effect: float) -> float:
        """The ratio B/A of a change; 1 + (B - A)/|A| of statistics that may have either sign."""
        if self.from_zero:
            return math.nan
        return math.exp(min(effect, 700.0)) if self.by_ratio else 1 + effect

    def slack(self, margin: float) -> float:
        """The margin on the scale of the change."""
        if self.from_zero:
            return 0.0
        return math.log1p(margin) if self.by_ratio else margin


def measured(a: Side, b: Side, quantity: Quantity) -> Measured:
    """A statistic of both and its change."""
    if a.seed != b.seed:
        return _apart(a, b, quantity)
    paired = _together(a, b, quantity)
    if paired is None:
        apart = _apart(a, b, quantity)
        return apart._replace(same=apart.change is not None and abs(apart.change.effect) <= ROUNDING)
    if paired.same or min(a.runs, b.runs) <= min(a.kept.count, b.kept.count):
        return paired
    # All runs of both, as if independent, may be worth more than the few of them that were kept.
    apart = _apart(a, b, quantity)
    known = [each.change.stderr if each.change else math.inf for each in (apart, paired)]
    return apart if known[0] < known[1] else paired


def _together(a: Side, b: Side, quantity: Quantity) -> Measured | None:
    """On the kept runs that both have and that count in both."""
    first, second = a.per_run(quantity), b.per_run(quantity)
    if first is None or second is None:
        return None
    count = min(len(first.values), len(second.values))
    both = first.counted[:count] & second.counted[:count]
    value_a, on_a = influences(quantity.statistic, first.values[:count][both])
    value_b, on_b = influences(quantity.statistic, second.values[:count][both])
    n = int(both.sum())
    effect = _effect(quantity, value_a, value_b)
    if n < 2:
        return Measured(quantity, value_a, value_b, n, n, True, Change(effect, math.nan, 0.0))
    with np.errstate(invalid="ignore", divide="ignore"):
        units = _units(quantity, value_a, value_b)
        shares = on_b / units[1] - on_a / units[0]
    sure = math.isinf(effect) or not np.isfinite(shares).all()
    change = Change(
        effect, 0.0 if sure else standard_error(shares), math.inf if sure else effective_degrees(shares)
    )
    same = value_a == value_b or (abs(effect) <= ROUNDING and change.stderr <= ROUNDING)
    return Measured(quantity, value_a, value_b, n, n, True, change, same=same)


def _apart(a: Side, b: Side, quantity: Quantity) -> Measured:
    """As of independent runs."""
    first, second = a.estimate(quantity), b.estimate(quantity)
    units = _units(quantity, first.value, second.value)
    stderrs = [each.stderr / unit for each, unit in zip((first, second), units, strict=True)]
    degrees = (
        satterthwaite(stderrs, (first.degrees, second.degrees)) if first.degrees and second.degrees else 0.0
    )
    change = Change(_effect(quantity, first.value, second.value), math.hypot(*stderrs), degrees)
    return Measured(quantity, first.value, second.value, first.n, second.n, False, change)


def _effect(quantity: Quantity, a: float, b: float) -> float:
    if a == b or math.isnan(a) or math.isnan(b):
        return b - a
    if _from_zero(quantity, a, b):
        return b - a
    return math.log(b / a) if quantity.statistic in SIZES else (b - a) / abs(a)


def _from_zero(quantity: Quantity, a: float, b: float) -> bool:
    """Whether there is no ratio: of errors, which are never negative, neither to zero nor from it."""
    return a == 0 or (b == 0 and quantity.statistic in SIZES)


def _units(quantity: Quantity, a: float, b: float) -> tuple[float, float]:
    """By what errors of both values are divided to become those of the change: d log x = dx/x, dx/|A|, or dx."""
    if _from_zero(quantity, a, b):
        return 1.0, 1.0
    return (a, b) if quantity.statistic in SIZES else (abs(a), abs(a))
