"""Figures of single runs: the true states, what the filters make of them, and the measurements, against time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from nlbench.figures import bands, style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

REACH = 0.5  # how far an axis follows an estimate beyond the truth, in the span of the truth
TRUTH = {"color": "#9a9a9a", "linewidth": 3.0, "alpha": 0.7}
MEASURED = {"color": "#555555", "linewidth": 0.6, "marker": ".", "markersize": 2.5, "markeredgewidth": 0}


def response(data: Data) -> Iterator[Picture]:
    """A picture for each run that the experiment file asks for: a panel for each state and each measurement."""
    saved = data.saved("responses")
    for number, rows in [] if saved is None else saved.groupby("trajectory", sort=False):
        yield _run(data, int(number), rows)


def _run(data: Data, number: int, rows: pd.DataFrame) -> Picture:
    from matplotlib.lines import Line2D

    measured = rows["kind"] == "measurement"
    states, measurements = (
        [(str(name), each) for name, each in part.groupby("name", sort=False)]
        for part in (rows[~measured], rows[measured])
    )
    figure = style.figure(1.0 + 1.35 * len(states) + 1.1 * len(measurements) + 0.1 * len(data.filters))
    heights = [1.35] * len(states) + [1.1] * len(measurements)
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    for axes, (name, each) in zip(panels, states, strict=False):
        _state(axes, data, each)
        words = style.with_unit(style.short(name, 16), data.units.get(name, ""))
        style.literal(axes.set_ylabel(words))
    for axes, (name, each) in zip(panels[len(states) :], measurements, strict=True):
        axes.plot(each["time"], each["value"], **MEASURED)
        words = f"measurement\n{name}" if len(measurements) > 1 else "measurement"
        style.literal(axes.set_ylabel(words))
    figure.align_ylabels(panels)
    style.literal(panels[-1].set_xlabel(style.with_unit("time", data.units["time"])))
    title = f"Truth, estimates and measurements in run {number:,}"
    if not measurements:
        title = f"Truth and estimates in run {number:,}"
    style.literal(panels[0].set_title(style.wrapped(title)))
    looks = style.looks(data.filters, data.reference)
    entries = {"truth": Line2D([], [], **TRUTH)}
    entries |= {label: Line2D([], [], **style.key(look)) for label, look in looks.items()}
    style.legend(figure, entries)
    return Picture(f"response-{number}", title, _words(title, states, measurements), figure)


def _state(axes: Axes, data: Data, rows: pd.DataFrame) -> None:
    """A state and every filter's estimate of it."""
    looks = style.looks(data.filters, data.reference)
    truth = rows[rows["kind"] == "truth"]
    axes.plot(truth["time"], truth["value"], **TRUTH)
    estimates = rows[rows["kind"] == "estimate"].groupby("filter", sort=False)
    for index, (label, each) in enumerate(estimates):
        axes.plot(each["time"], each["value"], **style.line(looks[str(label)], index, len(each)))
    axes.set_ylim(*bands.limits(_shown(truth["value"].to_numpy(), rows["value"].to_numpy()), np.empty(0)))


def _shown(truth: np.ndarray, values: np.ndarray) -> np.ndarray:
    """What an axis must show: the truth, and estimates until they are well beyond it."""
    truth = truth[np.isfinite(truth)]
    if not truth.size:
        return values
    low, high = truth.min(), truth.max()
    reach = REACH * (high - low or np.abs(truth).max() or 1.0)
    return np.clip(values, low - reach, high + reach)


def _words(
    title: str, states: list[tuple[str, pd.DataFrame]], measurements: list[tuple[str, pd.DataFrame]]
) -> str:
    """The last truth and, from the nearest to it, the last estimates; how many measurements there are."""
    parts = []
    for name, rows in states:
        last = rows[rows["time"] == rows["time"].max()]
        truth = float(last.loc[last["kind"] == "truth", "value"].iloc[0])
        ends = last[last["kind"] == "estimate"].set_index("filter")["value"]
        ends = ends.iloc[np.argsort(np.abs(ends - truth).fillna(np.inf).to_numpy(), kind="stable")]
        estimated = ", ".join(f"{label} {value:.3g}" for label, value in ends.items())
        parts.append(f"{name}: {truth:.3g} is true; {estimated}")
    words = f"{title}. At time {max(rows['time'].max() for _, rows in states):g}, {'. '.join(parts)}."
    for name, rows in measurements:
        low, high = rows["value"].min(), rows["value"].max()
        words += f" {len(rows):,} measurements {name} from {low:.3g} to {high:.3g}."
    return words
