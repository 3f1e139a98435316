"""Figure of how often each filter diverged, with Wilson intervals."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from nlbench.figures import style
from nlbench.figures.data import Data
from nlbench.figures.picture import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLE = "Diverged runs of each filter"


def divergence(data: Data) -> Iterator[Picture]:
    """Fraction of diverged runs per filter; nothing where no run diverged."""
    if not data.any_diverged:
        return
    rows = data.divergence.to_dict("records")
    looks = style.looks(data.filters, data.reference)
    figure = style.figure(0.9 + 0.34 * len(rows))
    axes = figure.subplots()
    for place, row in enumerate(rows):
        _interval(axes, place, row, looks[row["filter"]])
    axes.set_yticks(range(len(rows)), [style.short(row["filter"], 26) for row in rows])
    for text in axes.get_yticklabels():
        style.literal(text)
    axes.set_xlim(left=0)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlabel("diverged runs (%), with 95 % Wilson interval")
    axes.set_title(TITLE)
    yield Picture("divergence", TITLE, f"{TITLE}: {'; '.join(map(_words, rows))}.", figure)


def _interval(axes: Axes, place: int, row: dict[str, Any], look: style.Look) -> None:
    """A filter's fraction in percent with its interval, and the count beside it."""
    low, middle, high = (100 * row[name] for name in ("low", "fraction", "high"))
    reach = [[max(0.0, middle - low)], [max(0.0, high - middle)]]
    axes.errorbar(
        middle, place, xerr=reach, fmt=look.marker or "o", color=look.colour, capsize=2.5, clip_on=False
    )
    beside = axes.get_yaxis_transform()
    axes.text(1.02, place, _count(row), transform=beside, va="center", fontsize=7.5)


def _count(row: dict[str, Any]) -> str:
    return f"{row['diverged']:,.0f} of {row['n']:,.0f}"


def _words(row: dict[str, Any]) -> str:
    low, middle, high = (f"{100 * row[name]:.3g}" for name in ("low", "fraction", "high"))
    return f"{row['filter']} {_count(row)} ({middle} %, 95 % interval {low} to {high} %)"
