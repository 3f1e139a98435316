"""Statistics of how the filters foretold the measurements.

`nis` at a time is the mean over all samples since the output time before, of the runs that are not lost then; at `all`
over all samples of the runs that were never lost. Its `n` counts samples, so that n nis is chi-square with n m degrees
of freedom if the filter is right. Times at which no filter has a sample are left out. `log_likelihood` at a time is the
mean over runs of the sum over all measurements so far; its `n` counts the runs that are not lost and whose sum is
finite.
"""

from __future__ import annotations

import numpy as np

from nlbench.statistics.averages import Average, Estimate, estimate
from nlbench.statistics.ieee import ieee
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import Sums, enough_groups, jackknife


def scored(totals: Totals) -> list[Estimate]:
    """Both statistics, if scores were summed; they are of all entries of the measurement jointly."""
    groups, after_start = totals.groups, totals.layout.times[1:]
    if "nis" not in groups:
        return []
    nis, likelihood = (np.moveaxis(groups[name], 1, 0)[..., None] for name in ("nis", "log_likelihood"))
    sampled = nis[1].any(axis=(0, 1, 3))
    times = tuple(time for time, any_there in zip((*after_start, "all"), sampled, strict=True) if any_there)
    return [
        _mean_of_samples(times, nis[..., sampled, :]),
        estimate("log_likelihood", after_start, ("all",), Average(*likelihood)),
    ]


@ieee
def _mean_of_samples(times: tuple, sums: np.ndarray) -> Estimate:
    """The ratio r = sum a / sum c of NIS and samples; runs are independent, the samples of a run need not be.

    Below enough groups the delta method: with e = a - r c of each of N runs, the variance of r is
    sum e^2 / (sum c)^2 N / (N - 1).
    """

    def value_of(part: Sums) -> np.ndarray:
        return part["a"] / part["c"]

    runs, c, a, aa, ac, cc = sums.sum(1)
    parts = {"a": sums[2], "c": sums[1]}
    value = value_of({"a": a, "c": c})
    residual = np.maximum(aa - 2 * value * ac + value**2 * cc, 0)
    delta = np.where(runs > 1, np.sqrt(residual * runs / (runs - 1)) / c, np.nan)
    stderr = np.where(enough_groups(sums[1]), jackknife(value_of, parts, sums[1]), delta)
    return Estimate("nis", times, ("all",), value, stderr, c.astype(np.int64))
