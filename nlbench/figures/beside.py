"""Labels beside the points of a figure, where they hide neither each other nor another point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

from nlbench.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIZE = 7.0  # points of the letters
LETTER, LINE = 0.58 * SIZE, 1.25 * SIZE  # room of a letter and of a line, in points
INSIDE = 230.0, 170.0  # width and height of the axes, in points; the layout that decides it comes later
POINT = 3.5  # half the room of a point
DISTANCES = (5.0, 12.0, 20.0, 30.0, 42.0, 56.0)  # in points
# To the right and the left first; straight above and below last, where an interval hides the line.
DIRECTIONS = ((1, 0), (-1, 0), (0.8, 0.8), (-0.8, 0.8), (0.8, -0.8), (-0.8, -0.8), (0, 1), (0, -1))
NEAR = 8.0  # a label farther away is tied to its point by a line


class Box(NamedTuple):
    """A rectangle inside the axes, in points."""

    left: float
    bottom: float
    right: float
    top: float

    def shared(self, other: Box) -> float:
        """The area of both."""
        width = min(self.right, other.right) - max(self.left, other.left)
        height = min(self.top, other.top) - max(self.bottom, other.bottom)
        return max(width, 0.0) * max(height, 0.0)

    @property
    def area(self) -> float:
        return (self.right - self.left) * (self.top - self.bottom)


class Place(NamedTuple):
    """Where a label is: from its point, in points, and which of its sides is there."""

    x: float
    y: float
    side: str
    box: Box


def write(axes: Axes, points: Mapping[str, tuple[float, float]]) -> None:
    """Each label at the nearest place that is free, or at the freest, the longest first; scales and limits are set."""
    inside = Box(0.0, 0.0, *INSIDE)
    to_fraction = axes.transData + axes.transAxes.inverted()
    at = {
        label: tuple(part * size for part, size in zip(to_fraction.transform(point), INSIDE, strict=True))
        for label, point in points.items()
    }
    taken = [Box(x - POINT, y - POINT, x + POINT, y + POINT) for x, y in at.values()]
    for label, (x, y) in sorted(at.items(), key=lambda item: -len(item[0])):
        name = style.short(label, 24)

        def crowding(place: Place) -> float:
            outside = place.box.area - place.box.shared(inside)
            return outside + sum(place.box.shared(box) for box in taken)

        place = min(_places(x, y, LETTER * len(name)), key=crowding)
        taken.append(place.box)
        far = abs(place.x) + abs(place.y) > NEAR
        text = axes.annotate(
            name, points[label], (place.x, place.y), textcoords="offset points", fontsize=SIZE, ha=place.side,
            va="center", arrowprops={"arrowstyle": "-", "color": "#333333", "linewidth": 0.6} if far else None,
        )  # fmt: skip
        style.literal(text)


def _places(x: float, y: float, width: float) -> Iterator[Place]:
    """From the nearest, places for a label of this width beside the point (x, y)."""
    for distance in DISTANCES:
        for right, up in DIRECTIONS:
            side = "left" if right > 0 else "right" if right < 0 else "center"
            dx, dy = right * distance, up * (distance + LINE / 4)
            left = x + dx - {"left": 0.0, "right": 1.0, "center": 0.5}[side] * width
            yield Place(dx, dy, side, Box(left, y + dy - LINE / 2, left + width, y + dy + LINE / 2))
