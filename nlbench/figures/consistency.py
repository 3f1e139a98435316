"""Figure of how wrong the filters are for what they say: NEES and NIS against time, with chi-square bounds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

from nlbench.figures import scales, style
from nlbench.figures.data import Curve, Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCORES = {"nees": "NEES", "nis": "NIS"}
BOUNDS = {"color": "#9a9a9a", "alpha": 0.45, "linewidth": 0}
BOUNDS_WORDS = "95 % bounds if consistent"


class Panel(NamedTuple):
    """A score against time: the curve of each filter, and the degrees of freedom, which it should be near."""

    score: str
    dof: int
    curves: dict[str, Curve]
    time: np.ndarray
    low: np.ndarray
    high: np.ndarray


def nees(data: Data) -> Iterator[Picture]:
    """NEES, and NIS where something is measured; nothing of a run whose tables have neither."""
    gathered = [] if data.consistency is None else [_gathered(data, score) for score in SCORES]
    panels = [panel for panel in gathered if panel is not None]
    if not panels:
        return
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    figure = style.figure(1.3 + 1.6 * len(panels))
    drawn = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(drawn, panels, strict=True):
        _draw(axes, data, panel)
    title = f"{' and '.join(SCORES[panel.score] for panel in panels)}, {data.runs:,} runs"
    style.literal(drawn[0].set_title(style.wrapped(title)))
    style.literal(drawn[-1].set_xlabel(style.with_unit("time", data.units["time"])))
    looks = style.looks(data.filters, data.reference)
    entries = {label: Line2D([], [], **style.key(looks[label])) for label in data.filters}
    style.legend(figure, {**entries, BOUNDS_WORDS: Patch(**BOUNDS)})
    yield Picture("nees", title, _words(title, panels), figure)


def _gathered(data: Data, score: str) -> Panel | None:
    """The rows of a score at more than one time, with the widest bounds of any filter: all have about the same."""
    assert data.consistency is not None
    rows = data.consistency[data.consistency["score"] == score]
    rows = rows.assign(time=pd.to_numeric(rows["time"], errors="coerce")).dropna(subset="time")
    if rows["time"].nunique() < 2:
        return None
    columns = ("time", "value", "stderr", "n")
    curves = {
        label: Curve(*(each[column].to_numpy(float) for column in columns))
        for label, each in rows.groupby("filter", sort=False)
    }
    edges = rows.groupby("time").agg({"low": "min", "high": "max"})
    times, low, high = edges.index.to_numpy(float), edges["low"].to_numpy(), edges["high"].to_numpy()
    return Panel(score, int(rows["dof"].iloc[0]), curves, times, low, high)


def _draw(axes: Axes, data: Data, panel: Panel) -> None:
    looks = style.looks(data.filters, data.reference)
    axes.fill_between(panel.time, panel.low, panel.high, zorder=0.6, **BOUNDS)
    axes.axhline(panel.dof, color="#555555", linewidth=0.7)
    for index, (label, curve) in enumerate(panel.curves.items()):
        axes.plot(curve.time, curve.value, **style.line(looks[label], index, len(curve.time)))
    values = [curve.value for curve in panel.curves.values()]
    scales.positive(axes, np.concatenate([*values, panel.low, panel.high, [panel.dof]]), np.empty(0))
    axes.set_ylabel(f"{SCORES[panel.score]}\n({panel.dof} if consistent)")


def _words(title: str, panels: list[Panel]) -> str:
    """The last values in words, from the smallest."""
    words = f"{title}: mean squared errors of the state and residuals of the measurements, in what the filters state."
    for panel in panels:
        last = {label: curve.value[-1] for label, curve in panel.curves.items() if len(curve.value)}
        order = sorted(last, key=lambda label: (not np.isfinite(last[label]), last[label]))
        ends = ", ".join(f"{label} {last[label]:.3g}" for label in order)
        words += f" At time {panel.time[-1]:g} the {SCORES[panel.score]}, {panel.dof} if consistent: {ends}."
    return words
