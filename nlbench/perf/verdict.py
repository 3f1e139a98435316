"""The decision: is a ratio beyond the budget, within it, or is the machine too noisy to say?

With r = log(workload/kernel) of each round, the estimate is the median of r, and its band the order statistics that
hold the median with 99 % (Hahn and Meeker 1991, Statistical Intervals, 5.2: binomial ranks, no assumption on the
noise's shape). The A/A arm is the workload divided by itself, both of the same round: half of its second to first
log ratio is noise of the kind that r has, its median differs from zero by noise alone, and the band is at least that
wide. A change is the difference to the baseline's estimate, its band the root of both squares.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

CONFIDENCE = 0.99
PASS, SLOWER, UNDECIDED = "pass", "slower", "undecided"


class Estimate(NamedTuple):
    """log ratio, half the width of its band, and the same of the A/A arm, as a fraction; from how many rounds."""

    log_ratio: float
    band: float
    noise: float
    rounds: int

    @property
    def ratio(self) -> float:
        """The workload's time divided by the kernel's."""
        return math.exp(self.log_ratio)


class Change(NamedTuple):
    """Log of a ratio divided by the baseline's, and half the width of its band."""

    log: float
    band: float

    def verdict(self, budget: float) -> str:
        """Whether the change, with its band, lies above or below the budget."""
        limit = math.log1p(budget)
        if self.log - self.band > limit:
            return SLOWER
        return PASS if self.log + self.band < limit else UNDECIDED

    def suspect(self, budget: float) -> bool:
        """Whether it is slower for certain, and beyond the budget more likely than not."""
        return self.log > max(math.log1p(budget), self.band)


def estimate(seconds: np.ndarray) -> Estimate:
    """From (rounds, 2, 2) seconds: per round two pairs of kernel and workload."""
    totals = seconds.sum(axis=1)
    ratios = np.log(totals[:, 1] / totals[:, 0])
    again = np.log(seconds[:, 1, 1] / seconds[:, 0, 1]) / 2
    middle, band = _median(ratios)
    shift, spread = _median(again)
    return Estimate(middle, max(band, abs(shift)), abs(shift) + spread, len(ratios))


def change(now: Estimate, log_ratio: float, band: float) -> Change:
    """Now against a baseline's log ratio and band."""
    return Change(now.log_ratio - log_ratio, math.hypot(now.band, band))


def _median(values: np.ndarray) -> tuple[float, float]:
    """The median, and the distance of the farther end of its band."""
    ordered, n = np.sort(values), len(values)
    middle, low = float(np.median(values)), rank(n)
    return middle, float(max(middle - ordered[low], ordered[n - 1 - low] - middle))


@cache
def rank(n: int) -> int:
    """The largest k, from 0, for which the values numbered k and n - 1 - k of n in order hold the median with 99 %."""
    below, k = 0.0, 0
    while k < (n - 1) // 2:
        below += math.comb(n, k) / 2**n
        if 2 * (below + math.comb(n, k + 1) / 2**n) > 1 - CONFIDENCE:
            break
        k += 1
    return k
