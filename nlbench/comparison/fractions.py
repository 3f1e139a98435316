"""Fractions of diverged runs, compared by exact tests."""

from __future__ import annotations

import math

import numpy as np

from nlbench.comparison.change import ANY, Measured
from nlbench.comparison.side import Side
from nlbench.comparison.significance import fisher, mcnemar
from nlbench.statistics.comparisons import Quantity


def diverged(a: Side, b: Side, label: str, times: tuple[float, ...]) -> Measured:
    """Fractions of runs lost at any of the common report times: McNemar's test on the same runs, otherwise Fisher's."""
    quantity = Quantity(label, ANY, "all", "diverged")
    first, second = a.lost(label, times), b.lost(label, times)
    if a.seed == b.seed and min(len(first), len(second)) == min(a.runs, b.runs):
        count = min(len(first), len(second))
        first, second = first[:count], second[:count]
        only = int((first & ~second).sum()), int((second & ~first).sum())
        fractions = float(first.mean()), float(second.mean())
        return Measured(quantity, *fractions, count, count, True, None, mcnemar(*only), not any(only))
    (count_a, n_a), (count_b, n_b) = _lost(a, label, times, first), _lost(b, label, times, second)
    share_a, share_b = (count / n if n else math.nan for count, n in ((count_a, n_a), (count_b, n_b)))
    p = fisher(count_a, n_a, count_b, n_b)
    return Measured(quantity, share_a, share_b, n_a, n_b, False, None, p, count_a + count_b == 0)


def _lost(side: Side, label: str, times: tuple[float, ...], kept: np.ndarray) -> tuple[int, int]:
    """How many of how many runs: of all, unless they were also looked at when the other side's were not."""
    if set(times) == set(side.report_times):
        return side.diverged(label), side.runs
    return int(kept.sum()), len(kept)
