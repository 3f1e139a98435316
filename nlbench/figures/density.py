"""Figures of the error's density at the report times: what each filter implies, and what its errors show.

The form of figures 2.2-2.7 of Culver 1969, chapter 2: the average over the kept runs of the density that a filter's
variance and third moment imply (a Gaussian times a third-order Hermite series, or a Gaussian), against the density with
the first seven central moments of the errors; and a histogram of these, which no series flatters.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nlbench.figures import hermite, style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 7  # of the moments that the thesis's density of the errors has
CELLS = 240  # of a curve
LARGEST = 1e30  # no overflow of a third moment
HISTOGRAM = {"color": "#9a9a9a", "alpha": 0.45, "linewidth": 0}
SERIES = {"color": "#000000", "linewidth": 1.0}
IMPLIED = {"color": "#D55E00", "linewidth": 1.5, "linestyle": (0, (4, 1.5))}
REFERENCE = {"color": "#0072B2", "linewidth": 1.1, "linestyle": (0, (1.2, 1.2))}


class Sample(NamedTuple):
    """Of a filter at a report time: the errors (n,) of the runs that count, with the variance and the third moment that
    it states for them; how many runs it lost, and how many more have no positive variance."""

    error: np.ndarray
    variance: np.ndarray
    third: np.ndarray
    lost: int
    improper: int


Samples = dict[str, Sample]  # by filter


def density(data: Data) -> Iterator[Picture]:
    """A picture for each coordinate and report time with a panel for each filter; none without the columns."""
    runs = data.saved("runs")
    if runs is None:
        return
    for coordinate in runs.columns.intersection(list(data.units), sort=False):
        columns = [coordinate, f"{coordinate}_variance", f"{coordinate}_third"]
        if not set(columns) <= set(runs.columns):
            continue
        for time, rows in runs.groupby("time"):
            samples = {
                label: _sample(each[columns].to_numpy(float), each["diverged"].to_numpy(bool))
                for label, each in rows.groupby("filter", sort=False)
            }
            if any(len(sample.error) > 1 for sample in samples.values()):
                yield _picture(data, coordinate, float(time), samples)


def _sample(values: np.ndarray, diverged: np.ndarray) -> Sample:
    """From errors, variances and third moments (n, 3)."""
    error, variance, third = values.T
    lost = diverged | ~np.isfinite(error)
    proper = np.isfinite(variance) & (variance > 0)
    third = np.clip(np.where(np.isnan(third), 0.0, third), -LARGEST, LARGEST)
    counted = ~lost & proper
    return Sample(
        error[counted], variance[counted], third[counted], int(lost.sum()), int((~lost & ~proper).sum())
    )


def _picture(data: Data, coordinate: str, time: float, samples: Samples) -> Picture:
    columns = min(2, len(samples))
    rows = -(-len(samples) // columns)
    figure = style.figure(1.15 + 1.35 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    low, high = _range(samples)
    edges = np.linspace(low, high, CELLS + 1)
    reference = samples.get(data.reference or "")
    beside = None if reference is None else _implied(reference, edges)
    spans = [
        _panel(axes, label, samples[label], edges, None if label == data.reference else beside)
        for axes, label in zip(grid.flat, samples, strict=False)
    ]
    top = max(span[1] for span in spans)
    grid[0, 0].set_ylim(max(min(span[0] for span in spans), -0.25 * top) - 0.03 * top, 1.05 * top)
    grid[0, 0].set_xlim(low, high)
    for spare in grid.flat[len(samples) :]:
        spare.set_visible(False)
    for axes in grid.flat[max(0, len(samples) - columns) : len(samples)]:
        axes.tick_params(labelbottom=True)
    unit, error = data.units[coordinate], f"error of {style.short(coordinate)}"
    inverse = f"1/{unit}" if unit.isalnum() else f"1/({unit})" if unit else ""
    for axes in grid[:, 0]:
        style.literal(axes.set_ylabel(style.with_unit("density", inverse)))
    for axes in grid[-1]:
        style.literal(axes.set_xlabel(style.with_unit(error, unit)))
    kept = max(len(sample.error) + sample.lost + sample.improper for sample in samples.values())
    title = f"Density of the {error} at time {time:g}, {kept:,} runs"
    style.literal(figure.suptitle(style.wrapped(title), x=0.02, ha="left"))
    style.legend(figure, _entries(data, beside is not None))
    return Picture(f"density-{coordinate}-{time:g}", title, _words(title, samples), figure)


def _panel(
    axes: Axes, label: str, sample: Sample, edges: np.ndarray, beside: np.ndarray | None
) -> tuple[float, float]:
    """The densities of a filter. Returns the lowest and the highest value that the axis must show."""
    left_out = sample.lost + sample.improper
    name = f"{style.short(label, 14)}, {left_out:,} left out" if left_out else style.short(label, 24)
    style.literal(axes.set_title(name, fontweight="normal", fontsize=8))
    axes.axhline(0, color="#555555", linewidth=0.7)
    if len(sample.error) < 2:
        return 0.0, 0.0
    at = (edges[1:] + edges[:-1]) / 2
    bins = _bins(len(sample.error))
    bars, walls = np.histogram(sample.error, bins=np.linspace(edges[0], edges[-1], bins + 1))
    bars = bars / len(sample.error) / np.diff(walls)
    axes.stairs(bars, walls, fill=True, **HISTOGRAM)
    implied = _implied(sample, edges)
    axes.plot(at, implied, **IMPLIED)
    lowest, top = implied.min(), bars.max()
    if len(sample.error) > ORDER and sample.error.std() > 0:
        series = hermite.matched(sample.error, at, ORDER)
        axes.plot(at, series, **SERIES)
        lowest = min(lowest, series.min())
    if beside is not None:
        axes.plot(at, beside, **REFERENCE)
    return float(lowest), float(max(top, min(implied.max(), 2 * top)))


def _implied(sample: Sample, edges: np.ndarray) -> np.ndarray:
    if not len(sample.error):
        return np.zeros(len(edges) - 1)
    return hermite.average(sample.variance, sample.third, edges)


def _range(samples: Samples) -> tuple[float, float]:
    """Ends of the axis: about the middle 99 % of the errors of a filter that is neither the best nor the worst."""
    ends = [np.quantile(sample.error, (0.005, 0.995)) for sample in samples.values() if len(sample.error) > 1]
    low, high = np.median(ends, axis=0)
    margin = 0.15 * (high - low) or 1.0
    return float(low - margin), float(high + margin)


def _bins(count: int) -> int:
    """How many bars: three times the cube root of the number of errors, as far as they can be told apart."""
    return int(np.clip(3 * count ** (1 / 3), 8, 40))


def _entries(data: Data, beside: bool) -> dict[str, Any]:
    """What stands for each curve in the legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: dict[str, Any] = {
        "errors": Patch(**HISTOGRAM),
        "of their first 7 moments": Line2D([], [], **SERIES),
        "implied by the filter": Line2D([], [], **IMPLIED),
    }
    if beside:
        entries[f"implied by {data.reference}"] = Line2D([], [], **REFERENCE)
    return entries


def _words(title: str, samples: Samples) -> str:
    """What each filter states on average, and what is right; and which runs are left out."""
    words = (
        f"{title}: a histogram of the errors, the density with their first seven moments, "
        "and the average of the densities that the filter states."
    )
    parts = []
    for label, sample in samples.items():
        if len(sample.error) > 1:
            stated = f"{np.sqrt(sample.variance.mean()):.3g} and a third moment of {sample.third.mean():.3g}"
            third = ((sample.error - sample.error.mean()) ** 3).mean()
            actual = f"{sample.error.std():.3g} and {third:.3g}"
            parts.append(f"{label} states a standard deviation of {stated} where {actual} are right")
    words += f" {'; '.join(parts)}."
    out = [
        f"{label} {sample.lost:,} lost and {sample.improper:,} without a positive variance"
        for label, sample in samples.items()
        if sample.lost or sample.improper
    ]
    return f"{words} Runs left out: {'; '.join(out)}." if out else words
