"""Quantiles of the chi-square distribution, for any number of degrees of freedom up to some hundred millions."""

from __future__ import annotations

import math

import numpy as np

MOST_STEPS = 50
TOLERANCE = 1e-12


def quantile(probability: float, degrees: np.ndarray) -> np.ndarray:
    """The value that a chi-square variable of so many degrees of freedom exceeds with 1 - probability; NaN for none.

    Newton's method in y = (x / degrees)^(1/3), in which the distribution is nearly normal (Wilson and Hilferty 1931).
    """
    each, back = np.unique(np.asarray(degrees, float), return_inverse=True)
    found = np.full(each.shape, np.nan)
    fit = each > 0
    found[fit] = _solved(probability, each[fit])
    return found[back].reshape(np.shape(degrees))


def _solved(probability: float, k: np.ndarray) -> np.ndarray:
    a, y = k / 2, np.ones_like(k)
    for _ in range(MOST_STEPS if k.size else 0):
        x = k * y**3
        log_density = (a - 1) * np.log(x / 2) - x / 2 - _log_gamma(a) - math.log(2)
        step = (lower_gamma(a, x / 2) - probability) / (np.exp(log_density) * 3 * k * y**2)
        # The first steps of few degrees could leave the positive numbers.
        new = np.clip(y - step, y / 4, y * 4)
        done, y = np.abs(new - y) <= TOLERANCE * y, new
        if done.all():
            break
    return k * y**3


def lower_gamma(a: np.ndarray, x: np.ndarray) -> np.ndarray:
    """P(a, x) = x^a e^-x / Gamma(a + 1) sum_n x^n / ((a + 1) ... (a + n)), Abramowitz and Stegun 6.5.29.

    About 9 sqrt(a) terms where x is near a, as it is near the quantiles.
    """
    term, total, n = np.ones_like(x), np.ones_like(x), 0
    while (term > TOLERANCE / 100 * total).any():
        n += 1
        term = term * x / (a + n)
        total = total + term
    return np.exp(a * np.log(x) - x - _log_gamma(a + 1) + np.log(total))


def _log_gamma(a: np.ndarray) -> np.ndarray:
    return np.array([math.lgamma(each) for each in a])
