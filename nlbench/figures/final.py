"""Figures of the report times: every filter's error relative to the reference or the best filter, a row for each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nlbench.figures import bands, ratios, scales, style
from nlbench.figures.data import Data
from nlbench.figures.error_curves import WORDS
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROW = 0.12  # inches for each interval


class Row(NamedTuple):
    """A filter's ratios to the baseline at the report times, and half the widths of their 95 % intervals."""

    label: str
    time: np.ndarray
    ratio: np.ndarray
    reach: np.ndarray


def final(data: Data) -> Iterator[Picture]:
    """Clipped RMS errors, all runs counted (RMS errors where none are clipped), for each coordinate and norm."""
    statistic = "rms_clipped" if data.coordinates("rms_clipped") else "rms"
    others = [label for label in data.filters if label != data.baseline]
    for coordinate in data.coordinates(statistic) if others else ():
        rows = [Row(label, *ratios.intervals(data, label, statistic, coordinate)) for label in others]
        if any(np.isfinite(row.ratio).any() for row in rows):
            yield _picture(data, f"{WORDS[statistic]} of {style.short(coordinate)}", coordinate, rows)


def _picture(data: Data, words: str, coordinate: str, rows: list[Row]) -> Picture:
    from matplotlib.lines import Line2D

    times = sorted({time for row in rows for time in row.time})
    looks = [style.Look(style.COLOURS[i % 8], "", style.MARKERS[i % 9]) for i in range(len(times))]
    figure = style.figure(1.0 + (0.1 + ROW * len(times)) * len(rows))
    axes = figure.subplots()
    axes.axvline(1.0, color="#555555", linewidth=0.9)
    for place, row in enumerate(rows):
        for time, ratio, reach in zip(row.time, row.ratio, row.reach, strict=True):
            number = times.index(time)
            beside = ((number + 0.5) / len(times) - 0.5) * 0.75
            drawn = {**style.key(looks[number]), "markersize": 4.0, "linestyle": "none"}
            axes.errorbar(ratio, place + beside, xerr=reach, elinewidth=1.0, capsize=0, **drawn)
    _scale(axes, rows)
    axes.set_yticks(range(len(rows)), [style.short(row.label, 26) for row in rows])
    for text in axes.get_yticklabels():
        style.literal(text)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")
    for edge in range(1, len(rows)):
        axes.axhline(edge - 0.5, color="#dddddd", linewidth=0.5)
    title = f"{words[0].upper()}{words[1:]}, {data.runs:,} runs"
    style.literal(figure.suptitle(style.wrapped(title), x=0.02, ha="left"))
    style.literal(axes.set_xlabel(f"relative to {style.short(data.baseline)}, with 95 % interval"))
    entries = {
        f"time {time:g}": Line2D([], [], **style.key(look)) for time, look in zip(times, looks, strict=True)
    }
    style.legend(figure, entries)
    return Picture(f"final-{coordinate}", title, _words(data, title, rows), figure)


def _scale(axes: Axes, rows: list[Row]) -> None:
    """Linear, or logarithmic where ratios span more than is told apart on a linear axis."""
    ratio, reach = (np.concatenate([getattr(row, part) for row in rows]) for part in ("ratio", "reach"))
    shown = np.append(ratio[np.isfinite(ratio) & (ratio > 0)], 1.0)
    if shown.max() > ratios.LOGARITHMIC * shown.min():
        scales.logarithmic(axes, "x")
        axes.set_xlim(shown.min() / 1.3, shown.max() * 1.3)
    else:
        axes.set_xlim(*bands.limits(shown, np.concatenate([ratio - reach, ratio + reach])))


def _words(data: Data, title: str, rows: list[Row]) -> str:
    """Every ratio with its interval."""
    parts = []
    for row in rows:
        values = (
            f"{ratio:.3g} ({ratio - reach:.3g} to {ratio + reach:.3g}) at time {time:g}"
            for time, ratio, reach in zip(row.time, row.ratio, row.reach, strict=True)
        )
        parts.append(f"{row.label} {', '.join(values)}")
    return f"{title}, relative to {data.baseline}, with 95 % intervals: {'; '.join(parts)}."
