"""How every figure looks: one style, and for each filter a colour, a dash pattern and a marker of its own."""

from __future__ import annotations

import textwrap
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.text import Text

WIDTH = 4.0  # inches: readable at the width of a journal's column and of a phone
DPI = 220  # of the PNG, and of the layout: widths of letters are rounded to pixels
RC = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "figure.titlesize": 8.5,
    "figure.titleweight": "bold",
    "figure.labelsize": 8,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.2,
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 3.6,
    "svg.fonttype": "path",
}
# Okabe and Ito's colours without the yellow, which is too light for a line, and two darker ones.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7F3C8D", "#8C6D31")
DASHES = (
    "-",
    (0, (5, 1.5)),
    (0, (4, 1.2, 1, 1.2)),
    (0, (1.2, 1.2)),
    (0, (7, 1.5, 1, 1.5, 1, 1.5)),
    (0, (2.5, 1.2)),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">")
MARKERS_PER_CURVE = 6
GOLDEN = 0.381966  # of an interval between two markers: so far apart are those of two filters
COLUMN = 16  # letters of a label that still leave room for three columns of them
LINE = 54  # letters of a title
POWERS = {1: "", 2: "²", 3: "³"}


class Look(NamedTuple):
    """Colour, dash pattern and marker of a curve."""

    colour: str
    dash: Any
    marker: str


REFERENCE = Look("#000000", "-", "")


def looks(filters: tuple[str, ...], reference: str | None) -> dict[str, Look]:
    """A look for each filter: 72 filters before two share one. The reference is a plain black line."""
    others = [label for label in filters if label != reference]
    chosen = {
        label: Look(COLOURS[i % len(COLOURS)], DASHES[i % len(DASHES)], MARKERS[i % len(MARKERS)])
        for i, label in enumerate(others)
    }
    return chosen if reference is None else {**chosen, reference: REFERENCE}


def context(salt: str) -> AbstractContextManager[None]:
    """Matplotlib's defaults with this style on top, whatever the user has set; all is put back at the end."""
    import matplotlib.style

    return matplotlib.style.context(["default", {**RC, "svg.hashsalt": salt}])


def figure(height: float) -> Figure:
    """An empty figure of the common width, outside pyplot's list of figures."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained", dpi=DPI)


def line(look: Look, index: int = 0, points: int = 1) -> dict[str, Any]:
    """Arguments of `plot` for a look. Markers of different curves sit at different times, so none hides another."""
    every = max(1, points // MARKERS_PER_CURVE)
    order = 1.9 if look == REFERENCE else 2.0  # the reference lies under the filters that reach it
    first = int(every * (GOLDEN * index % 1.0))
    return {**key(look), "markevery": (first, every), "zorder": order}


def key(look: Look) -> dict[str, Any]:
    """Arguments of the line that stands for a look in a legend."""
    return {
        "color": look.colour,
        "linestyle": look.dash,
        "marker": look.marker,
        "markeredgecolor": "white",
        "markeredgewidth": 0.5,
    }


def literal(text: Text) -> Text:
    """The text as it is: a user's `$` is no formula."""
    text.set_parse_math(False)
    return text


def short(label: str, length: int = 30) -> str:
    """A label that fits its place, without characters that cannot be drawn."""
    label = "".join(character if character.isprintable() else " " for character in label)
    return label if len(label) <= length else label[: length - 1] + "…"


def wrapped(title: str) -> str:
    """A title in lines that fit the width."""
    return textwrap.fill(title, LINE)


def with_unit(words: str, unit: str, power: int = 1) -> str:
    """`words (unit)`, the unit raised to a power."""
    if not unit:
        return words
    base = f"({unit})" if power > 1 and not unit.isalnum() else unit
    return f"{words} ({base}{POWERS[power]})"


def legend(figure: Figure, entries: dict[str, Any]) -> None:
    """A legend below the axes, where it hides nothing: what stands for each label."""
    labels = [short(label) for label in entries]
    columns = 3 if max(map(len, labels)) <= COLUMN and len(labels) > 2 else 2
    box = figure.legend(
        list(entries.values()), labels, loc="outside lower center", ncols=columns, columnspacing=1.2
    )
    for text in box.get_texts():
        literal(text)
