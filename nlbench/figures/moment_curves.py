"""Figures of estimated against actual moments of the error, one panel per filter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nlbench.figures import bands, scales, style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOOKS = {
    "actual": style.Look("#000000", "-", "o"),
    "estimated": style.Look("#D55E00", (0, (4, 1.5)), "s"),
}


class Moment(NamedTuple):
    """A moment as the tables and as readers call it, with what its axis needs."""

    column: str
    words: str
    power: int
    scale: Callable[[Axes, np.ndarray, np.ndarray], None]
    floor: float


VARIANCE = Moment("variance", "variance", 2, scales.positive, 0.0)
THIRD = Moment("third", "third moment", 3, scales.signed, -np.inf)


def variance(data: Data) -> Iterator[Picture]:
    """The variance that a filter states, and the one that its errors have."""
    for coordinate in data.coordinates("variance_actual"):
        yield _panels("variance", data, coordinate, VARIANCE)


def third_moment(data: Data) -> Iterator[Picture]:
    """The third central moment that a filter states, and the one that its errors have."""
    for coordinate in data.coordinates("third_actual"):
        yield _panels("third_moment", data, coordinate, THIRD)


def _panels(name: str, data: Data, coordinate: str, moment: Moment) -> Picture:
    columns = min(2, len(data.filters))
    rows = -(-len(data.filters) // columns)
    figure = style.figure(0.95 + 1.4 * rows)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    drawn = [
        _panel(axes, data, label, coordinate, moment)
        for axes, label in zip(grid.flat, data.filters, strict=False)
    ]
    curves = [
        data.curve(label, coordinate, f"{moment.column}_{kind}") for label in data.filters for kind in LOOKS
    ]
    moment.scale(grid[0, 0], bands.steady(curves), np.concatenate(drawn))
    for spare in grid.flat[len(data.filters) :]:
        spare.set_visible(False)
    for axes in grid.flat[max(0, len(data.filters) - columns) : len(data.filters)]:
        axes.tick_params(labelbottom=True)
    for axes in grid[:, 0]:
        words = style.with_unit(moment.words, data.units.get(coordinate, ""), moment.power)
        style.literal(axes.set_ylabel(words))
    for axes in grid[-1]:
        style.literal(axes.set_xlabel(style.with_unit("time", data.units["time"])))
    words = f"{moment.words} of {style.short(coordinate)}"
    title = f"Estimated and actual {words}, {data.runs:,} runs"
    _finish(figure, data, title)
    return Picture(f"{name}-{coordinate}", title, f"{title}. {_ends(data, coordinate, moment)}", figure)


def _panel(axes: Axes, data: Data, label: str, coordinate: str, moment: Moment) -> np.ndarray:
    """Both curves of a filter, with their bands. Returns the edges of the source's band."""
    actual = data.curve(label, coordinate, f"{moment.column}_actual")
    band = (np.empty(0), np.empty(0))
    if data.source_runs:
        band = bands.of_runs(actual, data.source_runs, moment.floor)
        bands.draw_source(axes, actual.time, band)
    if moment.scale is scales.signed:
        axes.axhline(0, color="#555555", linewidth=0.7)
    for index, (kind, look) in enumerate(LOOKS.items()):
        curve = data.curve(label, coordinate, f"{moment.column}_{kind}")
        bands.draw_confidence(axes, curve, look.colour)
        axes.plot(curve.time, curve.value, **style.line(look, index * 2, len(curve.time)))
    style.literal(axes.set_title(style.short(label, 24), fontweight="normal", fontsize=8))
    return np.concatenate(band)


def _finish(figure: Figure, data: Data, title: str) -> None:
    """Title and legend."""
    from matplotlib.lines import Line2D

    style.literal(figure.suptitle(style.wrapped(title), x=0.02, ha="left"))
    entries = {kind: Line2D([], [], **style.key(look)) for kind, look in LOOKS.items()}
    style.legend(figure, {**entries, **bands.source_entry(data)})


def _ends(data: Data, coordinate: str, moment: Moment) -> str:
    """Estimated and actual value at the last time, in words."""
    parts = []
    for label in data.filters:
        ends = [data.curve(label, coordinate, f"{moment.column}_{kind}").value[-1:] for kind in LOOKS]
        if all(map(len, ends)):
            parts.append(f"{label} states {ends[1][0]:.3g} where {ends[0][0]:.3g} is right")
    return "At the last time: " + "; ".join(parts) + "."
