"""What a problem is: drift, measurement, noise, initial moments, and how errors are judged."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from nlbench.moments.moments import Moments

Function = Callable[..., Any]


class Coordinate(NamedTuple):
    """One component of the estimation error, as tables and figures name it."""

    name: str
    unit: str = ""


class Kind(NamedTuple):
    """What decides which filters a system is for: whether its time is discrete, and whether its measurements are
    continuous."""

    discrete: bool
    continuous: bool


class Sets(NamedTuple):
    """Initial states drawn together: `transform` maps a set's (size, n) standard normals to its (size, n) states."""

    size: int
    transform: Function


class Sightings(NamedTuple):
    """Measurements made at angles of a revolution, instead of at times.

    Sighting k, counted from 0, is due at the end of the first step at which the central angle, followed round and
    round from the start, has reached angles[k mod p] + period (k div p): that of the estimate, or of the undisturbed
    motion from the initial mean where `nominal`. What is measured is observe(marks[k mod p], x) and the noise of
    number k. A filter makes one sighting a step at most.

    angles, marks: (p,), ascending angles within a period, and what `observe` is told of each. rate: about how fast the
    angle grows. angle: x -> the central angle, whole turns left out or not. observe: (mark, x) -> (m,).
    """

    angles: tuple[float, ...]
    marks: tuple[float, ...]
    period: float
    rate: float
    angle: Function
    observe: Function
    nominal: bool = False

    def most(self, end: float) -> int:
        """How many sightings are provided for until `end`: one and a quarter times the expected number, and some."""
        return len(self.angles) * math.ceil(1.25 * self.rate * end / self.period + 1.0)

    def due(self, number: Any) -> Any:
        """The angle of sighting `number`."""
        import jax.numpy as jnp

        turn, place = number // len(self.angles), number % len(self.angles)
        return jnp.asarray(self.angles)[place] + self.period * turn

    def mark(self, number: Any) -> Any:
        """What `observe` is told of sighting `number`."""
        import jax.numpy as jnp

        return jnp.asarray(self.marks)[number % len(self.marks)]


class Sampling(NamedTuple):
    """What is left of continuous measurements where they are sampled: one in a `period`, from time 0 on, with the noise
    of one step. Filters take it as held until the next, or else as a pulse of one step with nothing between.
    """

    period: float
    held: bool


class LateError(NamedTuple):
    """A run diverges at its end if an error was large for long: the root mean square over the last `window` of the
    norm of the errors `members` above `bound`."""

    window: float
    bound: float
    members: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class ErrorRules:
    """How the errors of a system's estimates are named, and when a run has diverged, in whatever time.

    coordinates: names and units of the errors; default x1 ... xn (x for one state).
    error: (x, m) -> (c,) errors, true state minus estimate m of this system's state; default x - m.
    diverged: (c,) errors -> bool; default: never, apart from errors that are not finite.
    diverged_stays: whether a run diverged at a report time counts as diverged ever after.
    diverged_late: a rule that is judged once, at the end of a run.
    clip: (c,) bound on |error| in `rms_clipped`; default infinite.
    norms: named norms of the errors, each with the coordinates that it joins.
    """

    coordinates: tuple[Coordinate, ...] | None = None
    error: Function | None = None
    diverged: Function | None = None
    diverged_stays: bool = False
    diverged_late: LateError | None = None
    clip: tuple[float, ...] | None = None
    norms: dict[str, tuple[int, ...]] = field(default_factory=dict)

    def _accept(self, functions: dict[str, int], matrices: tuple[str, ...]) -> None:
        """Take numbers for matrices and vectors of one entry, and integers for floats: in the results of functions, by
        their rank, in matrices and in the initial moments."""
        from nlbench.shapes import as_floats, as_moments, as_rank

        taken = {name: as_floats(getattr(self, name), rank) for name, rank in functions.items()}
        taken |= {name: as_rank(getattr(self, name), 2) for name in matrices}
        taken["initial"] = as_moments(getattr(self, "initial", None))
        for name, value in taken.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class System(ErrorRules):
    """A continuous-time system dx = f dt + G dw, measured at discrete times or continuously.

    Shapes are those of one trajectory: n states, m measurements, s noises.

    drift: (t, x) -> (n,), or a tuple of n scalars. A number stands for a vector or a matrix of one entry throughout.
    observe: (t, x) -> (m,), or a tuple of m scalars.
    measurement_cov: (m, m), the covariance R of a sample, or the spectral density Gamma when `measurement` is
        "continuous".
    initial: moments that the filters start from, and that `sample` defaults to (normal).
    diffusion: (t, x) -> (n, s), the matrix G; None means no process noise.
    diffusion_cov: (s, s), the spectral density V of dw; None means the unit matrix.
    truth: another system that makes the data, when truth and filter model differ.
    sample: key -> (n,) draws an initial state; or `Sets`, when initial states are drawn in sets.
    residual: (y, h) -> (m,), y - h unless given (to wrap an angle, say).
    inputs: t -> known inputs u(t), then drift takes (t, x, u).
    step: default integration step; None means a tenth of the interval.
    interval: time between measurements; None means that nothing is measured, or only by sightings.
    sampling: how continuous measurements are sampled; None means that filters see all of them.
    sightings: measurements that wait for an angle; `observe` then serves where no sighting's number is given.
    exact: what the exact reference is made of, where there is one.

    How its errors are named and judged: `ErrorRules`, by keyword.
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
    inputs: Function | None = None
    step: float | None = None
    interval: float | None = None
    sampling: Sampling | None = None
    sightings: Sightings | None = None
    exact: Any = None

    def __post_init__(self) -> None:
        functions = {"drift": 1, "observe": 1, "diffusion": 2, "residual": 1, "error": 1, "sample": 1}
        self._accept(functions, ("measurement_cov", "diffusion_cov"))

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

    def sighted(self, number: Any) -> System:
        """The system as sighting `number` observes it."""
        assert self.sightings is not None
        mark, observe = self.sightings.mark(number), self.sightings.observe
        return replace(self, observe=lambda t, x: observe(mark, x))

    def innovation(self, y: Any, h: Any) -> Any:
        """y - h, or what the system puts in its place: (m,)."""
        return y - h if self.residual is None else self.residual(y, h)


def kind(system: Any) -> Kind:
    """The kind of a `System` or `DiscreteSystem`."""
    timed = isinstance(system, System)
    return Kind(discrete=not timed, continuous=timed and system.measurement == "continuous")


def state_names(n: int) -> list[str]:
    """Names of the states of a system that names none."""
    return ["x"] if n == 1 else [f"x{i + 1}" for i in range(n)]
