"""The panel below an RMS figure: every filter relative to the reference, or to the best where there is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlbench.figures import bands, scales, style
from nlbench.figures.data import Curve, Data

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STEP = 0.005  # of the width, between the intervals of two filters at one time
LOGARITHMIC = 5  # largest ratio that is still shown on a linear axis


def draw(axes: Axes, data: Data, statistic: str, coordinate: str) -> None:
    """Ratios to the baseline, with 95 % intervals of the paired comparisons, and the band of the source's runs."""
    looks = style.looks(data.filters, data.reference)
    baseline = data.curve(data.baseline, coordinate, statistic)
    unit = np.where(baseline.value > 0, baseline.value, np.nan)
    shown = [np.ones(1)]
    step = (baseline.time[-1] - baseline.time[0]) * STEP
    for index, label in enumerate(data.filters):
        curve = data.curve(label, coordinate, statistic)
        axes.plot(curve.time, curve.value / unit, **style.line(looks[label], index, len(curve.time)))
        time, ratio, reach = intervals(data, label, statistic, coordinate)
        beside = (index - (len(data.filters) - 1) / 2) * step
        axes.errorbar(
            time + beside, ratio, reach, fmt="none", ecolor=looks[label].colour, elinewidth=0.9, capsize=2
        )
        shown += [bands.steady([Curve(curve.time, curve.value / unit, curve.stderr / unit, curve.n)]), ratio]
    values = np.concatenate(shown)
    values = values[np.isfinite(values)]
    band = np.empty((2, 0))
    if data.source_runs:
        band = np.array(bands.of_runs(baseline, data.source_runs, floor=0.0)) / unit
        bands.draw_source(axes, baseline.time, (band[0], band[1]))
    if values.max() > LOGARITHMIC:
        scales.logarithmic(axes)
    else:
        axes.set_ylim(*bands.limits(values, band.ravel()))
    style.literal(axes.set_ylabel(f"relative to\n{style.short(data.baseline, 20)}"))


def intervals(
    data: Data, label: str, statistic: str, coordinate: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of the paired comparisons with the baseline; there, the ratio and half the width of its 95 % interval."""
    rows = data.paired
    pairs = [{"filter_a": label, "filter_b": data.baseline}, {"filter_a": data.baseline, "filter_b": label}]
    either = np.logical_or(
        *((rows["filter_a"] == p["filter_a"]) & (rows["filter_b"] == p["filter_b"]) for p in pairs)
    )
    rows = rows[either & (rows["coordinate"] == coordinate) & (rows["statistic"] == statistic)]
    time, difference = rows["time"].to_numpy(float), rows["stderr"].to_numpy(float)
    curves = [data.curve(name, coordinate, statistic) for name in (label, data.baseline)]
    a, b = ([part[np.searchsorted(curve.time, time - 1e-9)] for part in curve[1:3]] for curve in curves)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = a[0] / np.where(b[0] > 0, b[0], np.nan)
        return time, ratio, bands.Z95 * of_ratio(ratio, a[1], b[1], difference) / b[0]


def of_ratio(ratio: np.ndarray, a: np.ndarray, b: np.ndarray, difference: np.ndarray) -> np.ndarray:
    """The standard error of r = A/B in units of B, from those of A, B and A - B, by the delta method.

    var(A - r B) = (1 - r) var A + r (r - 1) var B + r var(A - B); of runs in common, A and B depend on each other.
    """
    return np.sqrt(np.maximum((1 - ratio) * a**2 + ratio * (ratio - 1) * b**2 + ratio * difference**2, 0.0))
