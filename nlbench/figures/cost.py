"""Figure of accuracy against cost: a point for each filter, and those that no other filter beats in both.

Costs are measured times, so this figure alone differs from one computation of the same run to another.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nlbench.figures import bands, beside, scales, style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

FRONT = {"color": "#9a9a9a", "linewidth": 3.0, "alpha": 0.5, "drawstyle": "steps-post"}
WIDE = 20  # a range of costs on whose axis there is room for powers of ten alone
FRONT_WORDS = "none is cheaper and better"


class Point(NamedTuple):
    """A filter: nanoseconds per trajectory and step, clipped RMS error and its standard error."""

    label: str
    cost: float
    error: float
    stderr: float


def cost(data: Data) -> Iterator[Picture]:
    """Clipped RMS error at the last report time, of the first norm or coordinate, against the time of a step."""
    table, coordinates = data.saved("cost"), data.coordinates("rms_clipped")
    if table is None or data.paired.empty or not coordinates:
        return
    time = float(data.paired["time"].max())
    coordinate = next((name for name in data.norms if name in coordinates), coordinates[0])
    spent = dict(zip(table["filter"], table["ns_per_step"], strict=True))
    points = [
        Point(label, spent[label], *data.at(label, coordinate, "rms_clipped", time))
        for label in data.filters
        if label in spent
    ]
    points = [point for point in points if point.cost > 0 and np.isfinite(point.error)]
    if len(points) > 1:
        yield _picture(data, coordinate, time, points)


def front(points: list[Point]) -> list[Point]:
    """From the cheapest, those that are better than every cheaper one."""
    found: list[Point] = []
    for point in sorted(points, key=lambda point: (point.cost, point.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def _picture(data: Data, coordinate: str, time: float, points: list[Point]) -> Picture:
    from matplotlib.lines import Line2D

    looks = style.looks(data.filters, data.reference)
    figure = style.figure(3.4)
    axes = figure.subplots()
    costs, errors, stderrs = (np.array([point[i] for point in points]) for i in (1, 2, 3))
    scales.logarithmic(axes, "x", (1.0,) if costs.max() > WIDE * costs.min() else (1.0, 2.0, 5.0))
    axes.set_xlim(costs.min() / 1.6, costs.max() * 1.6)
    reach = bands.Z95 * np.nan_to_num(stderrs)
    scales.positive(axes, errors, np.concatenate([errors - reach, errors + reach]))
    best = front(points)
    ends = [*best, best[-1]._replace(cost=float(axes.get_xlim()[1]))]
    axes.plot([point.cost for point in ends], [point.error for point in ends], zorder=1.5, **FRONT)
    for point, half in zip(points, reach, strict=True):
        look = looks[point.label]
        drawn = {**style.key(look), "marker": look.marker or "o", "linestyle": "none", "markersize": 5.5}
        axes.errorbar(point.cost, point.error, yerr=half, elinewidth=1.0, **drawn)
    beside.write(axes, {point.label: (point.cost, point.error) for point in points})
    words = f"clipped RMS error of {style.short(coordinate)} at time {time:g}"
    title = f"Cost and accuracy, {data.runs:,} runs"
    style.literal(axes.set_title(style.wrapped(title)))
    style.literal(axes.set_ylabel(style.with_unit(words, data.units.get(coordinate, ""))))
    axes.set_xlabel("nanoseconds per trajectory and integration step")
    style.legend(figure, {FRONT_WORDS: Line2D([], [], **FRONT)})
    return Picture("cost", title, _words(f"{title}: {words} against measured time", points, best), figure)


def _words(start: str, points: list[Point], best: list[Point]) -> str:
    """Every filter from the cheapest, and those that none beats in both."""
    order = sorted(points, key=lambda point: point.cost)
    ends = ", ".join(f"{point.label} {point.error:.3g} in {point.cost:.3g} ns" for point in order)
    names = ", ".join(point.label for point in best)
    return f"{start} per trajectory and integration step: {ends}. No other is both cheaper and better than: {names}."
