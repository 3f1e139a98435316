"""What a problem is: drift, measurement, noise, initial moments, and how errors are judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from nlbench.moments.moments import Moments

Function = Callable[..., Any]


class Coordinate(NamedTuple):
    """One component of the estimation error, as tables and figures name it."""

    name: str
    unit: str = ""


class Sets(NamedTuple):
    """Initial states drawn together: `transform` maps a set's (size, n) standard normals to its (size, n) states."""

    size: int
    transform: Function


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


@dataclass(frozen=True)
class System:
    """A continuous-time system dx = f dt + G dw, measured at discrete times or continuously.

    Shapes are those of one trajectory: n states, m measurements, s noises.

    drift: (t, x) -> (n,), or a tuple of n scalars.
    observe: (t, x) -> (m,), or a tuple of m scalars.
    measurement_cov: (m, m), the covariance R of a sample, or the spectral density Gamma when `measurement` is
        "continuous".
    initial: moments that the filters start from, and that `sample` defaults to (normal).
    diffusion: (t, x) -> (n, s), the matrix G; None means no process noise.
    diffusion_cov: (s, s), the spectral density V of dw; None means the unit matrix.
    truth: another system that makes the data, when truth and filter model differ.
    sample: key -> (n,) draws an initial state; or `Sets`, when initial states are drawn in sets.
    residual: (y, h) -> (m,), y - h unless given (to wrap an angle, say).
    coordinates: names and units of the errors; default x1 ... xn (x for one state).
    error: (x, m) -> (c,) errors, truth minus estimate; default x - m.
    diverged: (c,) errors -> bool; default: never, apart from errors that are not finite.
    diverged_stays: whether a run diverged at a report time counts as diverged ever after.
    clip: (c,) bound on |error| in `rms_clipped`; default infinite.
    inputs: t -> known inputs u(t), then drift takes (t, x, u).
    step: default integration step; None means a tenth of the interval.
    interval: time between measurements; None means that nothing is measured.
    exact: what the exact reference is made of, where there is one.
    norms: named norms of the errors, each with the coordinates that it joins.
    """

    drift: Function
    observe: Function
    measurement_cov: Any
    initial: Moments
    diffusion: Function | None = None
    diffusion_cov: Any = None
    measurement: Literal["discrete", "continuous"] = "discrete"
    truth: System | None = None
    sample: Function | Sets | None = None
    residual: Function | None = None
    coordinates: tuple[Coordinate, ...] | None = None
    error: Function | None = None
    diverged: Function | None = None
    diverged_stays: bool = False
    clip: tuple[float, ...] | None = None
    inputs: Function | None = None
    step: float | None = None
    interval: float | None = None
    exact: InitialGrid | KalmanBank | None = None
    norms: dict[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def states(self) -> int:
        """Number of states n."""
        return len(self.initial.mean)

    @property
    def measurements(self) -> int:
        """Number of measurements m taken at one time."""
        return len(self.measurement_cov)

    @property
    def default_step(self) -> float | None:
        """The integration step where nothing else is said: `step`, or a tenth of the interval."""
        if self.step is not None:
            return self.step
        return None if self.interval is None else self.interval / 10

    def drift_with_inputs(self, t: Any, x: Any) -> Any:
        """f(t, x), the known inputs u(t) put in: (n,)."""
        return self.drift(t, x) if self.inputs is None else self.drift(t, x, self.inputs(t))

    def diffusion_spectrum(self, t: Any, x: Any) -> Any:
        """G V G' at (t, x): (n, n). Only for systems with process noise."""
        import jax.numpy as jnp

        assert self.diffusion is not None
        G = jnp.asarray(self.diffusion(t, x))
        V = jnp.eye(G.shape[1]) if self.diffusion_cov is None else jnp.asarray(self.diffusion_cov)
        return G @ V @ G.T

    def innovation(self, y: Any, h: Any) -> Any:
        """y - h, or what the system puts in its place: (m,)."""
        return y - h if self.residual is None else self.residual(y, h)
