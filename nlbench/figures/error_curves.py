"""Figures of the estimation error against time: root mean square and mean, one curve per filter."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nlbench.figures import bands, ratios, scales, style
from nlbench.figures.data import Curve, Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BOUND = {"color": "#000000", "linewidth": 1.0, "linestyle": (0, (1, 1.2))}
BOUND_WORDS = "Cramer-Rao bound"
WORDS = {"rms": "RMS error", "rms_clipped": "clipped RMS error", "mean_error": "mean error"}


class Subject(NamedTuple):
    """What a figure shows: a statistic of a coordinate."""

    data: Data
    statistic: str
    coordinate: str

    @property
    def words(self) -> str:
        return f"{WORDS[self.statistic]} of {style.short(self.coordinate)}"

    @property
    def title(self) -> str:
        return f"{self.words[0].upper()}{self.words[1:]}, {self.data.runs:,} runs"


def rms(data: Data) -> Iterator[Picture]:
    """RMS error against time, and relative to the reference or the best filter."""
    for coordinate in data.coordinates("rms"):
        yield _root_mean_square(Subject(data, "rms", coordinate))


def rms_clipped(data: Data) -> Iterator[Picture]:
    """The same with errors clipped and every run counted: drawn where a filter diverges."""
    for coordinate in data.coordinates("rms_clipped") if data.any_diverged else ():
        yield _root_mean_square(Subject(data, "rms_clipped", coordinate))


def mean_error(data: Data) -> Iterator[Picture]:
    """Mean error (truth minus estimate) against time."""
    for coordinate in data.coordinates("mean_error"):
        subject = Subject(data, "mean_error", coordinate)
        figure = style.figure(3.3)
        axes = figure.subplots()
        axes.axhline(0, color="#555555", linewidth=0.7)
        scales.signed(axes, *_curves(axes, subject))
        _finish(figure, axes, axes, subject)
        words = f"{subject.title}, truth minus estimate. {_ends(subject)}"
        yield Picture(f"mean_error-{coordinate}", subject.title, words, figure)


def _root_mean_square(subject: Subject) -> Picture:
    data = subject.data
    compared = len(data.filters) > 1
    figure = style.figure(4.5 if compared else 3.2)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2)) if compared else [figure.subplots()]
    scales.positive(panels[0], *_curves(panels[0], subject))
    words = f"{subject.title}. {_ends(subject)}"
    bound = _bound(subject)
    if bound is not None:
        words += (
            f" The Cramer-Rao bound, which no filter's error over all runs is below: {bound.value[-1]:.3g}."
        )
    if subject.statistic == "rms" and data.any_diverged:
        words += " Diverged runs are left out."
    if compared:
        ratios.draw(panels[1], data, subject.statistic, subject.coordinate)
        words += f" The lower panel shows the same relative to {data.baseline}."
    _finish(figure, panels[0], panels[-1], subject)
    return Picture(f"{subject.statistic}-{subject.coordinate}", subject.title, words, figure)


def _curves(axes: Axes, subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Every filter's curve with its confidence band, over the source's band. Returns what the axis must show."""
    data, statistic, coordinate = subject
    looks = style.looks(data.filters, data.reference)
    band = (np.empty(0), np.empty(0))
    if data.source_runs:
        baseline = data.curve(data.baseline, coordinate, statistic)
        band = bands.of_runs(baseline, data.source_runs, -np.inf if statistic == "mean_error" else 0.0)
        bands.draw_source(axes, baseline.time, band)
    curves = [data.curve(label, coordinate, statistic) for label in data.filters]
    for index, (label, curve) in enumerate(zip(data.filters, curves, strict=True)):
        bands.draw_confidence(axes, curve, looks[label].colour)
        axes.plot(curve.time, curve.value, **style.line(looks[label], index, len(curve.time)))
    bound = _bound(subject)
    if bound is not None:
        axes.plot(bound.time, bound.value, zorder=1.8, **BOUND)
        curves.append(bound)
    return bands.steady(curves), np.concatenate(band)


def _bound(subject: Subject) -> Curve | None:
    """The bound of the root mean square errors of runs that are all counted."""
    return subject.data.bound(subject.coordinate) if subject.statistic == "rms" else None


def _finish(figure: Figure, top: Axes, bottom: Axes, subject: Subject) -> None:
    """Title, labels of the axes, legend."""
    from matplotlib.lines import Line2D

    data = subject.data
    style.literal(top.set_title(style.wrapped(subject.title)))
    style.literal(top.set_ylabel(style.with_unit(subject.words, data.units.get(subject.coordinate, ""))))
    style.literal(bottom.set_xlabel(style.with_unit("time", data.units["time"])))
    looks = style.looks(data.filters, data.reference)
    entries = {label: Line2D([], [], **style.key(looks[label])) for label in data.filters}
    if _bound(subject) is not None:
        entries[BOUND_WORDS] = Line2D([], [], **BOUND)
    style.legend(figure, {**entries, **bands.source_entry(data)})


def _ends(subject: Subject) -> str:
    """The last values in words, from the smallest."""
    data, statistic, coordinate = subject
    curves = {label: data.curve(label, coordinate, statistic) for label in data.filters}
    last = {label: curve.value[-1] for label, curve in curves.items() if len(curve.value)}
    order = sorted(last, key=lambda label: (not np.isfinite(last[label]), abs(last[label])))
    time = max(curve.time[-1] for curve in curves.values() if len(curve.time))
    return f"At time {time:g}: " + ", ".join(f"{label} {last[label]:.3g}" for label in order) + "."
