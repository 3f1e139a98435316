"""The tables of an experiment, made from its totals."""

from collections.abc import Iterable

import numpy as np
import pandas as pd

from nlbench.statistics.averages import averages
from nlbench.statistics.error_moments import error_moments
from nlbench.statistics.kept import Reported
from nlbench.statistics.layout import Layout
from nlbench.statistics.medians import medians
from nlbench.statistics.moments import moments_table
from nlbench.statistics.paired import paired_table
from nlbench.statistics.scores import scored
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import wilson

STATISTICS = (
    "rms",
    "rms_clipped",
    "rms_run_mean",
    "median_error",
    "mean_error",
    "variance_estimated",
    "variance_actual",
    "third_estimated",
    "third_actual",
    "nees",
    "coverage_95",
    "diverged",
    "nis",
    "log_likelihood",
)


def tables(totals: Totals) -> dict[str, pd.DataFrame]:
    """All tables that need nothing but the totals."""
    return {
        "statistics": statistics_table(totals),
        "moments": moments_table(totals),
        "paired": paired_table(totals),
        "divergence": divergence_table(totals),
        "runs": runs_table(totals),
    }


def statistics_table(totals: Totals) -> pd.DataFrame:
    """`filter, time, coordinate, statistic, value, stderr, n`, sorted in the order of the layout.

    `time` is text: the shortest that reads back as the same number ("0.5", "2.0"), or "all".
    """
    layout = totals.layout
    estimates = [*averages(totals), *error_moments(totals), medians(totals), *scored(totals)]
    times = (*layout.times, "all")
    coordinates = (*layout.magnitudes, "all")
    keys, values = [], []
    for estimate in estimates:
        f, t, c = np.indices(estimate.value.shape).reshape(3, -1)
        time = np.array([times.index(time) for time in estimate.times], int)[t]
        coordinate = np.array([coordinates.index(name) for name in estimate.coordinates], int)[c]
        keys.append(np.stack([f, time, coordinate, np.full_like(f, STATISTICS.index(estimate.statistic))]))
        values.append([part.ravel() for part in (estimate.value, estimate.stderr, estimate.n)])
    key = np.concatenate(keys, axis=1)
    order = np.lexsort(key[::-1])
    value, stderr, n = (np.concatenate(part)[order] for part in zip(*values, strict=True))
    names = (
        layout.filters,
        [*(repr(float(time)) for time in layout.times), "all"],
        coordinates,
        STATISTICS,
    )
    columns = ("filter", "time", "coordinate", "statistic")
    labels = {
        column: np.array(name, object)[index]
        for column, name, index in zip(columns, names, key[:, order], strict=True)
    }
    return pd.DataFrame({**labels, "value": value, "stderr": stderr, "n": n})


def divergence_table(totals: Totals) -> pd.DataFrame:
    """A row per filter: runs lost at any report time, Wilson's 95 % interval, how often the guard fired."""
    layout, groups = totals.layout, totals.groups
    first_lost, guarded = groups["first_lost"].sum(0), groups["guarded"].sum(0)
    diverged = first_lost.sum(-1)
    low, high = wilson(diverged, totals.runs)
    updates = groups["updates"].sum(0)
    return pd.DataFrame(
        {
            "filter": list(layout.filters),
            "n": totals.runs,
            "diverged": diverged.astype(np.int64),
            "fraction": diverged / totals.runs,
            "low": low,
            "high": high,
            "first_time_median": [_median_time(layout, counts) for counts in first_lost],
            "guarded": guarded.astype(np.int64),
            "guarded_fraction": np.where(updates > 0, guarded / np.maximum(updates, 1), 0.0),
        }
    )


def _median_time(layout: Layout, counts: np.ndarray) -> float:
    """Median over the lost runs of the first report time at which they are lost; NaN if there are none."""
    times = np.repeat(layout.report_times, (counts > 0).astype(int))
    filled = np.cumsum(counts[counts > 0])
    if not len(filled):
        return np.nan
    middle = (filled[-1] - 1) // 2, filled[-1] // 2
    return float(np.mean([times[np.searchsorted(filled, rank, side="right")] for rank in middle]))


def runs_table(totals: Totals) -> pd.DataFrame:
    """The first `keep_runs` runs: `filter, time, run`, per coordinate the error and the `_variance` and `_third` moment
    that the filter states for it (single precision), and `diverged`."""
    layout = totals.layout
    kept = Reported(*(part[..., : layout.keep_runs] for part in totals.kept.runs))
    f, r, run = np.indices(kept.lost.shape).reshape(3, -1)
    columns: Iterable[tuple[str, np.ndarray]] = (
        (f"{name}{suffix}", part[:, :, c].ravel())
        for suffix, part in (("", kept.error), ("_variance", kept.variance), ("_third", kept.third))
        for c, name in enumerate(layout.coordinates)
    )
    return pd.DataFrame(
        {
            "filter": np.array(layout.filters, object)[f],
            "time": np.array(layout.report_times)[r],
            "run": run,
            **dict(columns),
            "diverged": kept.lost.ravel(),
        }
    )
