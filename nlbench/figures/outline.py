"""Outlines of an SVG in fewer bytes: without points that cannot be seen to be missing, and as steps of whole cells."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

TOKENS = re.compile(r"[A-Za-z]|-?[\d.]+(?:e-?\d+)?")
POINTS = {
    "M": 1,
    "L": 1,
    "Q": 2,
    "C": 3,
    "Z": 0,
}  # of a command as matplotlib writes it, all of them absolute

Command = tuple[str, np.ndarray]  # a letter and its points (k, 2)


def shortened(outline: str, cell: float, decimals: int, tolerance: float) -> str:
    """The outline in units of `cell`, rounded to `decimals`.

    tolerance: how far, in the units of the outline, a straight line may pass by the points that it replaces.
    """
    grid = 10**decimals
    here = start = np.zeros(2, int)
    written, implied = [], ""
    for letter, points in _thinned(list(_commands(outline)), tolerance):
        if letter == "Z":
            written.append("z")
            here, implied = start, ""
            continue
        corners = np.round(points * (grid / cell)).astype(int)
        steps = corners - here
        if letter == "L" and not steps.any():
            continue
        here = corners[-1]
        if letter == "M":
            start = here
        name, numbers = letter.lower(), steps.ravel()
        if letter == "L" and 0 in numbers:
            name, numbers = ("v", numbers[1:]) if numbers[0] == 0 else ("h", numbers[:1])
        text = _numbers(numbers, decimals)
        between = name if name != implied else "" if text.startswith("-") else " "
        written.append(between + text)
        implied = "l" if name == "m" else name
    return "".join(written)


def number(value: float, decimals: int) -> str:
    """A number rounded, without what can be left out."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    text = re.sub(r"^(-?)0\.", r"\1.", text)
    return "0" if text in ("-0", "") else text


def extent(outline: str) -> float:
    """The larger side of the outline."""
    points = np.concatenate([points for _, points in _commands(outline)] or [np.zeros((1, 2))])
    return float(np.ptp(points, axis=0).max())


def _commands(outline: str) -> Iterator[Command]:
    tokens = TOKENS.findall(outline)
    place = 0
    while place < len(tokens):
        letter = tokens[place].upper()
        count = 2 * POINTS[letter]
        yield letter, np.array(tokens[place + 1 : place + 1 + count], float).reshape(-1, 2)
        place += 1 + count


def _thinned(commands: list[Command], tolerance: float) -> Iterator[Command]:
    """With fewer points where straight lines follow one another."""
    place = 0
    while place < len(commands):
        end = place
        while end < len(commands) and commands[end][0] == "L":
            end += 1
        if place == 0 or end - place < 2:
            yield commands[place]
            place += 1
            continue
        corners = np.concatenate(
            [commands[place - 1][1][-1:], *(points for _, points in commands[place:end])]
        )
        for corner in corners[needed(corners, tolerance)][1:]:
            yield "L", corner[None]
        place = end


def needed(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Which of the points (n, 2) of a line have to stay (Ramer 1972, Douglas and Peucker 1973): (n,), both ends do."""
    stay = np.zeros(len(points), bool)
    stay[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        along, between = points[last] - points[first], points[first + 1 : last] - points[first]
        length = np.hypot(*along)
        # Along the line, since a curve may return behind its ends.
        share = np.clip(between @ along / length**2, 0.0, 1.0) if length > 0 else np.zeros(len(between))
        away = np.hypot(*(between - share[:, None] * along).T)
        worst = int(away.argmax())
        if away[worst] > tolerance:
            middle = first + 1 + worst
            stay[middle] = True
            spans += [(first, middle), (middle, last)]
    return stay


def _numbers(values: np.ndarray, decimals: int) -> str:
    """Whole numbers of grid cells, apart from each other only by a sign where that is enough."""
    return " ".join(number(value / 10**decimals, decimals) for value in values).replace(" -", "-")
