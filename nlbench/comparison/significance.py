"""Tests of a change against a margin, of fractions, and Holm's correction of their p-values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

FOUND = 0.9  # probability with which a change of the size called detectable is found


class Estimate(NamedTuple):
    """A statistic with its standard error, the runs behind it, and the degrees of freedom of its standard error."""

    value: float
    stderr: float
    n: int
    degrees: float


class Change(NamedTuple):
    """A change with its standard error and the degrees of freedom of that: of a logarithm, or relative."""

    effect: float
    stderr: float
    degrees: float

    def p_beyond(self, slack: float) -> float:
        """Of the hypothesis that the true change is at most `slack`, either way; two-sided for slack 0.

        The largest probability under it of an estimate so far from 0, which is that for a true change of `slack`.
        """
        size = abs(self.effect)
        if self.stderr == 0:
            return float(size <= slack)
        away = np.array([size - slack, size + slack]) / self.stderr
        return min(float(special.stdtr(self.degrees, -away).sum()), 1.0)

    def interval(self, alpha: float) -> tuple[float, float]:
        """The interval at 1 - alpha."""
        reach = self.stderr * _t(alpha / 2, self.degrees) if self.stderr else 0.0
        return self.effect - reach, self.effect + reach

    def detects(self, slack: float, alpha: float) -> float:
        """The size of the change that a test at level alpha finds beyond `slack` with probability `FOUND`."""
        if self.stderr == 0:
            return slack
        return slack + self.stderr * (_t(alpha / 2, self.degrees) + _t(1 - FOUND, self.degrees))


def _t(tail: float, degrees: float) -> float:
    """The value that Student's t exceeds with this probability."""
    return -float(special.stdtrit(degrees, tail))


def satterthwaite(stderrs: Sequence[float], degrees: Sequence[float]) -> float:
    """Degrees of freedom of the root of a sum of squared standard errors (Welch 1947, Satterthwaite 1946)."""
    squares = np.square(stderrs)
    spread = float((squares**2 / np.asarray(degrees, float)).sum())
    return float(squares.sum()) ** 2 / spread if spread > 0 else math.inf


def standard_error(influence: np.ndarray) -> float:
    """Of a statistic on which the runs have these influences."""
    return float(influence.std() / math.sqrt(len(influence) - 1)) if len(influence) > 1 else math.nan


def effective_degrees(influence: np.ndarray) -> float:
    """Degrees of freedom of a variance that is estimated from these independent numbers: 2 n / (kurtosis - 1).

    A variance with k degrees of freedom varies by the fraction sqrt(2/k); that of n numbers by sqrt((kurtosis - 1)/n).
    For n normal numbers that is n, for the squares of normal errors n/7, and few where few runs decide.
    """
    square = (influence - influence.mean()) ** 2
    variance = square.mean()
    excess = float((square**2).mean() / variance**2) - 1 if variance > 0 else 0.0
    return 2 * len(influence) / excess if excess > 0 else math.inf


def mcnemar(only_a: int, only_b: int) -> float:
    """Exact two-sided p-value of McNemar's test, from the runs that only one of two has diverged in."""
    from scipy import stats

    both = only_a + only_b
    return float(stats.binomtest(only_a, both).pvalue) if both else 1.0


def fisher(count_a: int, n_a: int, count_b: int, n_b: int) -> float:
    """Exact two-sided p-value of Fisher's test of two fractions."""
    from scipy import stats

    return float(stats.fisher_exact([[count_a, n_a - count_a], [count_b, n_b - count_b]]).pvalue)


def holm(p_values: Sequence[float]) -> np.ndarray:
    """Holm's (1979) adjusted p-values: those at most alpha are rejected at level alpha, all taken together."""
    p = np.asarray(p_values, float)
    order = np.argsort(p, kind="stable")
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(np.maximum.accumulate((len(p) - np.arange(len(p))) * p[order]), 1.0)
    return adjusted
