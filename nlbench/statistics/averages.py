"""Statistics that are the mean of a quantity over runs, or the square root of one, with standard errors."""

from typing import NamedTuple

import numpy as np

from nlbench.statistics.ieee import ieee
from nlbench.statistics.layout import Layout
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import Sums, enough_groups, jackknife


class Estimate(NamedTuple):
    """A statistic with its standard error and the runs that enter: arrays (filters, times, coordinates)."""

    statistic: str
    times: tuple[float | str, ...]
    coordinates: tuple[str, ...]
    value: np.ndarray
    stderr: np.ndarray
    n: np.ndarray


class Average(NamedTuple):
    """Runs, sums of a quantity, and of its square about `origin`: (groups, filters, times, coordinates)."""

    runs: np.ndarray
    first: np.ndarray
    second: np.ndarray
    factor: float | np.ndarray = 1.0  # from the unit of the sums to that of the statistic
    origin: float | np.ndarray = 0.0
    root: bool = False


@ieee
def estimate(statistic: str, times: tuple, coordinates: tuple[str, ...], average: Average) -> Estimate:
    """Value and standard error: jackknife if enough groups are filled, otherwise the delta method."""

    def value_of(sums: Sums) -> np.ndarray:
        mean = average.origin + sums["first"] / sums["count"]
        return average.factor * (np.sqrt(np.maximum(mean, 0)) if average.root else mean)

    shape = np.broadcast_shapes(average.runs.shape, average.first.shape)
    count = np.broadcast_to(average.runs, shape).astype(np.float64)
    sums = {"count": count, "first": average.first.astype(np.float64)}
    n, first, second = count.sum(0), average.first.sum(0), average.second.sum(0)
    value = value_of({"count": n, "first": first})
    variance = np.maximum(second / n - (first / n) ** 2, 0) / (n - 1)
    # The derivative of factor sqrt(mean) is factor^2 / (2 value); where the root is 0, all terms are.
    slope = np.where(value > 0, average.factor**2 / (2 * value), 0.0) if average.root else average.factor
    delta = np.where(n > 1, np.abs(slope) * np.sqrt(variance), np.nan)
    stderr = np.where(enough_groups(count), jackknife(value_of, sums, count), delta)
    return Estimate(statistic, times, coordinates, value, stderr, n.astype(np.int64))


def averages(totals: Totals) -> list[Estimate]:
    """All statistics of this kind."""
    layout, groups = totals.layout, totals.groups
    names, magnitudes, norms = layout.coordinates, layout.magnitudes, tuple(layout.norms)
    scale, everything = np.array(layout.scale), ("all",)
    alive = groups["alive"][..., None]
    runs = np.broadcast_to(groups["total"][:, None, None, None], alive.shape)
    lost, covered = runs - alive, groups["covered"]
    own = scale[: len(names)]
    first, spread = np.moveaxis(groups["first"], 1, 0), np.moveaxis(groups["spread"], 1, 0)
    clipped, norm, nees = (np.moveaxis(groups[name], 1, 0) for name in ("clipped", "norm", "nees"))
    at_times = (
        ("variance_estimated", names, Average(alive, first[0], spread[0], own**2, totals.pivot[1])),
        ("third_estimated", names, Average(alive, first[1], spread[1], own**3, totals.pivot[2])),
        ("rms_clipped", magnitudes, Average(runs, clipped[0], clipped[1], scale, root=True)),
        ("rms", norms, Average(alive, norm[0], norm[1], scale[len(names) :], root=True)),
        ("nees", (*names, *everything), Average(nees[0], nees[1], nees[2])),
        ("coverage_95", names, Average(alive, covered, covered)),
        ("diverged", everything, Average(runs, lost, lost)),
    )
    rows = [estimate(statistic, layout.times, which, average) for statistic, which, average in at_times]
    return [*rows, *_over_time(groups, layout, scale)]


def _over_time(groups: Sums, layout: Layout, scale: np.ndarray) -> list[Estimate]:
    """Over all runs that were never lost and all output times after the start."""
    never = groups["never"][:, :, None, None]
    square, fourth, root = np.moveaxis(groups["run"], 1, 0)[..., None, :]
    pooled = Average(never, square, fourth, factor=scale, root=True)
    per_run = Average(never, root, square, factor=scale)
    return [
        estimate("rms", ("all",), layout.magnitudes, pooled),
        estimate("rms_run_mean", ("all",), layout.magnitudes, per_run),
    ]
