"""Linear or logarithmic: the scale of an axis by the range of what it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nlbench.figures import bands

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DECADES = 20  # a range of positive values from which the small ones would be lost on a linear axis
SPREAD = 1e4  # the same for values of either sign: the largest against the median


def positive(axes: Axes, values: np.ndarray, band: np.ndarray) -> None:
    """Logarithmic where positive values span a factor of twenty or more; what is not positive falls off the axis."""
    drawn = values[np.isfinite(values) & (values > 0)]
    if drawn.size and drawn.max() > DECADES * drawn.min():
        logarithmic(axes)
        axes.set_ylim(drawn.min() / 1.5, drawn.max() * 1.5)
    else:
        axes.set_ylim(*bands.limits(values, band))


def signed(axes: Axes, values: np.ndarray, band: np.ndarray) -> None:
    """Linear near zero and logarithmic away from it, where magnitudes demand it."""
    sizes = np.abs(values[np.isfinite(values) & (values != 0)])
    if sizes.size and sizes.max() > SPREAD * np.median(sizes):
        axes.set_yscale("symlog", linthresh=float(np.quantile(sizes, 0.25)))
    else:
        axes.set_ylim(*bands.limits(values, band))


def logarithmic(axes: Axes, direction: str = "y", ticks: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """A logarithmic scale whose ticks, at these multiples of powers of ten, are written as plain numbers (which
    matplotlib also draws ten times faster)."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(**{f"{direction}scale": "log"})
    axis = axes.xaxis if direction == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(subs=ticks, numticks=8))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
