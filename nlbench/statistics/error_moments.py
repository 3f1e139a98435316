"""Mean, RMS, variance and third central moment of the errors, with standard errors.

Moments have n, not n - 1, in the denominator, so that rms^2 = mean_error^2 + variance_actual exactly.
"""

from collections.abc import Callable

import numpy as np

from nlbench.statistics.averages import Estimate
from nlbench.statistics.ieee import ieee
from nlbench.statistics.powers import shifted
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import Sums, enough_groups, jackknife


@ieee
def error_moments(totals: Totals) -> list[Estimate]:
    """The four statistics at every output time, for runs that are not lost then."""
    layout, groups = totals.layout, totals.groups
    pivot = totals.pivot[0]
    scale = np.array(layout.scale[: len(layout.coordinates)])
    sums = {"n": groups["alive"][..., None], **{f"d{k + 1}": groups["power"][:, k] for k in range(3)}}
    weight = np.broadcast_to(sums["n"], sums["d1"].shape)
    total = {name: value.sum(0) for name, value in sums.items()}
    n = np.broadcast_to(total["n"], pivot.shape)
    variances = _delta_variances(n, groups["power"].sum(0), pivot)
    estimates = []
    for statistic, (order, formula) in _STATISTICS.items():

        def value_of(part: Sums, formula: Callable = formula) -> np.ndarray:
            return formula(pivot, *(part[f"d{k}"] / part["n"] for k in (1, 2, 3)))

        value = value_of(total)
        delta = np.where(n > 1, np.sqrt(np.maximum(variances[statistic], 0) / (n - 1)), np.nan)
        stderr = np.where(enough_groups(weight), jackknife(value_of, sums, weight), delta)
        factor = scale**order
        coordinates = layout.coordinates
        row = Estimate(
            statistic, layout.times, coordinates, factor * value, factor * stderr, n.astype(np.int64)
        )
        estimates.append(row)
    return estimates


def _rms(pivot: np.ndarray, d1: np.ndarray, d2: np.ndarray, d3: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(pivot * pivot + 2 * pivot * d1 + d2, 0))


def _mean(pivot: np.ndarray, d1: np.ndarray, d2: np.ndarray, d3: np.ndarray) -> np.ndarray:
    return pivot + d1


def _variance(pivot: np.ndarray, d1: np.ndarray, d2: np.ndarray, d3: np.ndarray) -> np.ndarray:
    return np.maximum(d2 - d1 * d1, 0)


def _third(pivot: np.ndarray, d1: np.ndarray, d2: np.ndarray, d3: np.ndarray) -> np.ndarray:
    return d3 - 3 * d1 * d2 + 2 * d1**3


# Power of the unit, and the formula in raw moments d1, d2, d3 about the pivot.
_STATISTICS = {
    "rms": (1, _rms),
    "mean_error": (1, _mean),
    "variance_actual": (2, _variance),
    "third_actual": (3, _third),
}


def _delta_variances(n: np.ndarray, power: np.ndarray, pivot: np.ndarray) -> dict[str, np.ndarray]:
    """n times the asymptotic variances, by the influence functions of the statistics.

    With x the deviation from the mean m and c_k its moments: mean x; variance x^2 - c2; third
    x^3 - c3 - 3 c2 x; rms (x^2 - c2 + 2 m x) / (2 rms).
    """
    raw = np.concatenate([np.ones((1, *n.shape)), power / n])
    _, _, c2, c3, c4, _, c6 = shifted(raw, -raw[1])
    mean = pivot + raw[1]
    square = c4 - c2**2
    rms_squared = c2 + mean**2
    rms = (square + 4 * mean * c3 + 4 * mean**2 * c2) / (4 * rms_squared)
    return {
        "mean_error": c2,
        "variance_actual": square,
        "third_actual": c6 - c3**2 - 6 * c2 * c4 + 9 * c2**3,
        "rms": np.where(rms_squared > 0, rms, 0.0 * n),
    }
