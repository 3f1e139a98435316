"""Standard errors by deleting groups, intervals of fractions, and p-values."""

import math
from collections.abc import Callable, Mapping

import numpy as np

from nlbench.statistics.ieee import ieee

JACKKNIFE_GROUPS = 32  # with fewer filled groups, standard errors come from the delta method
NORMAL_975 = 1.959963984540054  # the 97.5 % quantile of the standard normal

Sums = Mapping[str, np.ndarray]


@ieee
def jackknife(statistic: Callable[[Sums], np.ndarray], sums: Sums, weight: np.ndarray) -> np.ndarray:
    """Standard error of a statistic of sums (groups, ...) by deleting one group after another.

    Groups may differ in size, `weight` (groups, ...) being the runs in each: with h = n / weight, the
    pseudo-values are h theta - (h - 1) theta_without and the variance is the mean over groups of
    (pseudo-value - jackknife estimate)^2 / (h - 1) (Busing, Meijer and van der Leeden 1999). Empty groups do
    not count. NaN for one group.
    """
    total = {name: value.sum(0) for name, value in sums.items()}
    whole = statistic(total)
    without = statistic({name: total[name] - value for name, value in sums.items()})
    filled = np.broadcast_to(weight > 0, without.shape)
    groups = filled.sum(0)
    h = weight.sum(0) / weight
    pseudo = h * whole - (h - 1) * without
    estimate = groups * whole - np.where(filled, (1 - 1 / h) * without, 0).sum(0)
    variance = np.where(filled, (pseudo - estimate) ** 2 / (h - 1), 0).sum(0) / groups
    return np.where(groups > 1, np.sqrt(variance), np.nan)


def enough_groups(weight: np.ndarray) -> np.ndarray:
    """Whether enough groups (first axis) are filled for the jackknife."""
    return (weight > 0).sum(0) >= JACKKNIFE_GROUPS


@ieee
def wilson(count: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The 95 % interval of a fraction after Wilson (1927)."""
    z2 = NORMAL_975**2
    fraction = count / n
    centre = (fraction + z2 / (2 * n)) / (1 + z2 / n)
    half = NORMAL_975 * np.sqrt(fraction * (1 - fraction) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    # Exactly, not to rounding, where no run or every run counts.
    return np.where(count == 0, 0.0, centre - half), np.where(count == n, 1.0, centre + half)


def p_value(difference: float, stderr: float) -> float:
    """Two-sided, for a normal statistic; a difference without any spread is certain, none at all is not."""
    if math.isnan(difference) or math.isnan(stderr) or math.isinf(difference):
        return math.nan
    if stderr == 0:
        return float(difference == 0)
    return math.erfc(abs(difference) / stderr / math.sqrt(2))
