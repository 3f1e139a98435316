"""Figures of single runs: the errors of every filter against time, one panel per coordinate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from nlbench.figures import scales, style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_DEVIATIONS = 4  # filters whose own standard deviations can be told apart in one panel
REACH = 3.0  # how far an axis follows a diverged filter, in the largest error of those that did not diverge
DEVIATION = {"linewidth": 0.7, "alpha": 0.75, "linestyle": (0, (1, 1))}


class Path(NamedTuple):
    """The error of a filter in one coordinate, the standard deviation that it states, and whether it diverged."""

    time: np.ndarray
    error: np.ndarray
    deviation: np.ndarray
    diverged: bool


Paths = dict[tuple[str, str], Path]  # by coordinate and filter


def trace(data: Data) -> Iterator[Picture]:
    """Errors of the runs that the experiment file asks for, with the filters' own standard deviations."""
    for number, rows in data.traces.groupby("trajectory", sort=False):
        yield _run(data, int(number), _paths(rows))


def _paths(rows: pd.DataFrame) -> Paths:
    lost = rows.groupby("filter")["diverged"].any()
    paths = {}
    for (coordinate, label), each in rows.groupby(["coordinate", "filter"], sort=False):
        time, error, deviation = (each[column].to_numpy(float) for column in ("time", "error", "deviation"))
        paths[coordinate, label] = Path(time, error, deviation, bool(lost[label]))
    return paths


def _run(data: Data, number: int, paths: Paths) -> Picture:
    from matplotlib.lines import Line2D

    coordinates = tuple(dict.fromkeys(coordinate for coordinate, _ in paths))
    figure = style.figure(1.0 + 1.35 * len(coordinates) + 0.1 * len(data.filters))
    panels = figure.subplots(len(coordinates), 1, sharex=True, squeeze=False)[:, 0]
    for axes, coordinate in zip(panels, coordinates, strict=True):
        _panel(axes, data, {label: path for (c, label), path in paths.items() if c == coordinate})
        words = style.with_unit(style.short(coordinate, 16), data.units.get(coordinate, ""))
        style.literal(axes.set_ylabel(f"error of\n{words}"))
    figure.align_ylabels(panels)
    style.literal(panels[-1].set_xlabel(style.with_unit("time", data.units["time"])))
    title = f"Errors in run {number:,}"
    style.literal(panels[0].set_title(style.wrapped(title)))
    looks = style.looks(data.filters, data.reference)
    lost = {label for (_, label), path in paths.items() if path.diverged}
    entries = {
        f"diverged: {label}" if label in lost else label: Line2D([], [], **style.key(look))
        for label, look in looks.items()
    }
    if _with_deviations(data):
        entries["± own standard deviation"] = Line2D([], [], color="#555555", **DEVIATION)
    style.legend(figure, entries)
    return Picture(f"trace-{number}", title, _words(data, title, paths), figure)


def _panel(axes: Axes, data: Data, paths: dict[str, Path]) -> None:
    """The errors of one coordinate."""
    looks = style.looks(data.filters, data.reference)
    axes.axhline(0, color="#555555", linewidth=0.7)
    for index, (label, path) in enumerate(paths.items()):
        axes.plot(path.time, path.error, **style.line(looks[label], index, len(path.time)))
        if _with_deviations(data):
            for edge in (path.deviation, -path.deviation):
                axes.plot(path.time, edge, color=looks[label].colour, **DEVIATION)
    band = [path.deviation for path in paths.values() if not path.diverged] if _with_deviations(data) else []
    edges = np.concatenate([np.empty(0), *band])
    scales.signed(axes, _shown(paths), np.concatenate([edges, -edges]))


def _with_deviations(data: Data) -> bool:
    """Whether the filters are few enough."""
    return len(data.filters) <= MOST_DEVIATIONS


def _shown(paths: dict[str, Path]) -> np.ndarray:
    """What an axis must show: all of the filters that did not diverge, and the others until they are well beyond."""
    sound = np.concatenate([np.empty(0), *(path.error for path in paths.values() if not path.diverged)])
    lost = np.concatenate([np.empty(0), *(path.error for path in paths.values() if path.diverged)])
    largest = np.abs(sound[np.isfinite(sound)]).max(initial=0.0)
    reach = REACH * largest if largest > 0 else np.inf
    return np.concatenate([sound, np.clip(lost, -reach, reach)])


def _words(data: Data, title: str, paths: Paths) -> str:
    """The last errors in words, from the smallest, each with the standard deviation that the filter states."""
    words = f"{title}, truth minus estimate"
    if _with_deviations(data):
        words += "; thin lines: plus and minus the standard deviation that each filter states"
    time = max(path.time[-1] for path in paths.values())
    words += f". At time {time:g}, with the stated standard deviation: "
    parts = []
    for coordinate in dict.fromkeys(coordinate for coordinate, _ in paths):
        last = {label: path for (c, label), path in paths.items() if c == coordinate}
        order = sorted(
            last, key=lambda label: (not np.isfinite(last[label].error[-1]), abs(last[label].error[-1]))
        )
        ends = (f"{label} {last[label].error[-1]:.3g} ({last[label].deviation[-1]:.3g})" for label in order)
        parts.append(f"{coordinate}: {', '.join(ends)}")
    lost = dict.fromkeys(label for (_, label), path in paths.items() if path.diverged)
    return words + "; ".join(parts) + "." + (f" Diverged: {', '.join(lost)}." if lost else "")
