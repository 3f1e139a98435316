"""The systems that C kernels are written from: drifts and measurements, with their derivatives by hand.

They share no code with the drifts in `workloads`, which the other rows differentiate by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from benchmarks import workloads
from benchmarks.kernels.tensors import Expansion, Slope
from benchmarks.kernels.trace import Number, Trace, Value

State = list[Value]


class Model(NamedTuple):
    """The drift's expansion about x; what is measured, (m,), as true states need it; its slope H as updates do too."""

    expand: Callable[[Trace, State], Expansion]
    observe: Callable[[Trace, State], list[Number]]
    slope: Callable[[Trace, State], Slope]


def scalar(trace: Trace, x: State) -> Expansion:
    """-2x + .7x^2."""
    (m,) = x
    return Expansion([m * (0.7 * m - 2.0)], {(0, 0): 1.4 * m - 2.0}, {(0, 0, 0): 1.4})


def oscillator(trace: Trace, x: State) -> Expansion:
    """(x2, -x1 - 2 x2 x3, 0)."""
    position, velocity, damping = x
    a, b = -2.0 * damping, -2.0 * velocity
    slope = {(0, 1): 1.0, (1, 0): -1.0, (1, 1): a, (1, 2): b}
    return Expansion([velocity, a * velocity - position, 0.0], slope, {(1, 1, 2): -2.0, (1, 2, 1): -2.0})


def orbit(trace: Trace, x: State) -> Expansion:
    """(u, v) and the accelerations -mu (x, y)/r^3: the slope of mu/r, whose third derivatives are symmetric."""
    X, Y, U, V = x
    inverse_square = trace.quotient(1.0, X * X + Y * Y)
    g = -workloads.MU * (inverse_square * trace.call("root", inverse_square, operations=1))
    c = -3.0 * (g * inverse_square)
    d = 5.0 * (c * inverse_square)
    cX, dXX, dYY = c * X, d * (X * X), d * (Y * Y)
    slope: dict[tuple[int, int], Number] = {(0, 2): 1.0, (1, 3): 1.0}
    slope |= {(2, 0): g + cX * X, (2, 1): cX * Y, (3, 0): cX * Y, (3, 1): g + (c * Y) * Y}
    third = [
        X * (3.0 * c - dXX),
        Y * (c - dXX),
        X * (c - dYY),
        Y * (3.0 * c - dYY),
    ]  # by how many indices are y
    curvature = {(2 + i, a, b): third[i + a + b] for i in range(2) for a in range(2) for b in range(2)}
    return Expansion([U, V, g * X, g * Y], slope, curvature)


def angle(trace: Trace, x: State) -> list[Number]:
    """The direction of the landmark as seen from x."""
    east, north = (landmark - position for landmark, position in zip(workloads.LANDMARK, x, strict=False))
    return [trace.call("angle", north, east, operations=ANGLE_OPERATIONS)]


def angle_slope(trace: Trace, x: State) -> Slope:
    """Its slope."""
    east, north = (landmark - position for landmark, position in zip(workloads.LANDMARK, x, strict=False))
    over = trace.quotient(1.0, east * east + north * north)
    return {(0, 0): north * over, (0, 1): -(east * over)}


ANGLE_OPERATIONS = 50  # `angle` in normals.h: 21 terms at two each, and eight; choices are not counted
MODELS = {
    "scalar": Model(scalar, lambda trace, x: list(x), lambda trace, x: {(0, 0): 1.0}),
    "oscillator": Model(
        oscillator, lambda trace, x: list(x[:2]), lambda trace, x: {(0, 0): 1.0, (1, 1): 1.0}
    ),
    "orbit": Model(orbit, angle, angle_slope),
}
