"""What the exact references of systems are made of: plain records, which `nlbench.references` turns into filters."""

from __future__ import annotations

from typing import Any, NamedTuple


class PointMass(NamedTuple):
    """The posterior of a system in discrete time with one or two states, as probabilities of the points of a fixed
    grid. Noise must enter the transition and the measurement linearly.

    lower, upper: (n,), the first and last points. points: (n,), how many there are along each axis.
    """

    lower: tuple[float, ...]
    upper: tuple[float, ...]
    points: tuple[int, ...]


class ZakaiGrid(NamedTuple):
    """The posterior of a scalar system in continuous time, with or without process noise, as probabilities of the
    cells of a fixed grid.

    lower, upper: the ends of the grid, halfway outside the first and last cell. points: number of cells.
    """

    lower: float
    upper: float
    points: int


class LinearGaussian(NamedTuple):
    """The system is linear and Gaussian, so the Kalman filter is exact."""


class ParameterBank(NamedTuple):
    """The exact posterior of a system in discrete time whose last state is an unknown constant, and which is linear and
    Gaussian once that constant is known: one Kalman filter for each of a grid of its values.

    nodes: (p,) values of the last state. weights: (p,), prior probabilities.
    mean: (k,), cov: (k, k): the other k = n - 1 states at the start, whatever the constant.
    """

    nodes: Any
    weights: Any
    mean: Any
    cov: Any
