"""What the exact references of systems are made of: plain records, which `nlbench.references` turns into filters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from nlbench.systems.system import System

Function = Callable[..., Any]


class InitialGrid(NamedTuple):
    """The exact posterior of a scalar system without process noise: a known map of a grid of initial conditions.

    points: (p,). weights: (p,), prior probabilities. flow: (t, points) -> (p,) states, infinite where escaped.
    """

    points: Any
    weights: Any
    flow: Function


class KalmanBank(NamedTuple):
    """The exact posterior of a system whose last state is an unknown constant, and which is linear and Gaussian once
    that constant is known: one Kalman filter for each of a grid of its values.

    nodes: (p,) values of the last state. weights: (p,), prior probabilities.
    mean: (k,), cov: (k, k): the other k = n - 1 states at the start, whatever the constant.
    drift: (p, k, k), the matrix A of dx = A x dt + noise for each node. spectrum: (k, k), that of the noise, or None.
    """

    nodes: Any
    weights: Any
    mean: Any
    cov: Any
    drift: Any
    spectrum: Any = None


class InitialPosterior(NamedTuple):
    """The nearly exact posterior of a system without process noise, with a normal prior: a density of the initial
    state, by importance sampling.

    flow: (t, x0) -> (n,), the motion in closed form. companion: the system whose linearised filter decides when the
    reference makes a sighting; None means the system itself. most: how many measurements it can remember.
    radii, turns: how many points are laid, as `nlbench.references.points` says.
    """

    flow: Function
    companion: System | None = None
    most: int = 64
    radii: int = 5
    turns: int = 2


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
