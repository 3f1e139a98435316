"""Bands around a curve: its own confidence, and what as few runs as the source made would show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.figures.data import Curve, Data

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Z95 = 1.959964  # two-sided 95 % point of the normal distribution
SOURCE = {"color": "#9a9a9a", "alpha": 0.28, "linewidth": 0}


def confidence(curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """The 95 % confidence band of the curve."""
    return curve.value - Z95 * curve.stderr, curve.value + Z95 * curve.stderr


def of_runs(curve: Curve, runs: int, floor: float = -np.inf) -> tuple[np.ndarray, np.ndarray]:
    """The band in which 95 % of the curves estimated from `runs` runs would lie, not below `floor`.

    The standard error of n runs falls as 1/sqrt(n), so that of N runs is sqrt(n/N) times as large. This holds for
    a root mean square too, by the delta method, as long as the fourth moment of the errors exists.
    """
    spread = Z95 * curve.stderr * np.sqrt(curve.n / runs)
    return np.maximum(curve.value - spread, floor), curve.value + spread


def draw_confidence(axes: Axes, curve: Curve, colour: str) -> None:
    """Shade the confidence band in the curve's own colour."""
    axes.fill_between(curve.time, *confidence(curve), color=colour, alpha=0.2, linewidth=0)


def draw_source(axes: Axes, time: np.ndarray, band: tuple[np.ndarray, np.ndarray]) -> None:
    """Shade the band of the source's number of runs, below everything else."""
    axes.fill_between(time, *band, zorder=0.5, **SOURCE)


def source_entry(data: Data) -> dict[str, Any]:
    """Legend entry of the source's band; none when the source's number of runs is unknown."""
    from matplotlib.patches import Patch

    if not data.source_runs:
        return {}
    runs = "1 run" if data.source_runs == 1 else f"{data.source_runs:,} runs"
    return {f"95 % range of {runs}": Patch(**SOURCE)}


def steady(curves: list[Curve]) -> np.ndarray:
    """The values that an axis must show: those known to a quarter of the range of them all.

    Where one run in thousands has an enormous error, a mean over them is hardly known and may be beyond every
    other value; it then runs off the axis, with its confidence band.
    """
    value, stderr = (
        np.concatenate([getattr(curve, part) for curve in curves]) for part in ("value", "stderr")
    )
    value, stderr = value[np.isfinite(value)], stderr[np.isfinite(value)]
    if not value.size:
        return value
    low, high = np.quantile(value, (0.05, 0.95))
    known = value[~(stderr > (high - low) / 4)]
    return known if known.size else value


def limits(values: np.ndarray, band: np.ndarray) -> tuple[float, float]:
    """Limits of a linear axis: they show all values, and of a band no more than leaves the values half the height."""
    values, band = values[np.isfinite(values)], band[np.isfinite(band)]
    if not values.size:
        return 0.0, 1.0
    low, high = values.min(), values.max()
    room = (high - low or abs(high) or 1.0) / 2
    lowest = max(band.min(initial=low), low - room)
    highest = min(band.max(initial=high), high + room)
    margin = 0.05 * (highest - lowest or room)
    return float(lowest - margin), float(highest + margin)
