"""Quantiles of the chi-square distribution."""

from __future__ import annotations

import numpy as np
from scipy import special


def quantile(probability: float, degrees: np.ndarray) -> np.ndarray:
    """The value that a chi-square variable of so many degrees of freedom exceeds with 1 - probability; NaN for none."""
    k = np.asarray(degrees, float)
    some = k > 0
    # Half of it has a gamma distribution; scipy.stats, which has the quantile itself, takes half a second to load.
    return np.where(some, 2 * special.gammaincinv(np.where(some, k, 1.0) / 2, probability), np.nan)
