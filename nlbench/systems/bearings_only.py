"""Bearings from two sensors of a target that turns (Hartikainen, Solin and Sarkka 2011, table 3.3).

  filters think   p' = v,   v' = white noise of spectral density .1 on each axis           printed
  the target      goes at speed 1 from the origin along x, and turns thrice to the right by about 90 degrees: in steps
                  50 to 100, 200 to 250 and 350 to 400 at pi/2/(51 dt) + .01 N(0, 1) rad/s, drawn for every step
  bearings        atan2(y - s_y, x - s_x) + noise of .05 rad, sensors at (-1, -2) and (1, 1)    printed
State p = (x, y), v; time in seconds, steps of dt = .01, 500 of them; length has no unit (printed). The turns are those
of the toolbox that the source describes. It is in the benchmark because the measurement is nonlinear and the motion is
not what filters think; a hand-coded second derivative of atan2 once made the second-order filter look bad here.

Filters start from mean 0 and variances .1 of position and 10 of velocity, the target from (0, 0, 1, 0) (printed); the
first bearings are taken after the first step. Discretised exactly. In the source's table the errors of the EKF and the
UKF, .114 and .113, are of 1,000 runs; those of the cubature and Gauss-Hermite filters, .108 and .107, are of 100, the
same runs for both (a remark in the manual's source), with standard errors of .0027.
Diverged (chosen): a position error above 5, thrice the size of the course.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "a turning target, seen by the bearings of two sensors (Hartikainen, Solin and Sarkka 2011)"
TIME = "discrete"

STEP = 0.01  # s
SENSORS = ((-1.0, -2.0), (1.0, 1.0))
START = (0.0, 0.0, 1.0, 0.0)
TURNS = ((50, 100), (200, 250), (350, 400))  # first and last steps, counted from 1
TURN_RATE = math.pi / 2 / (51 * STEP)  # rad/s
LOST = 5.0


class Parameters(BaseModel):
    """Parameters of `bearings-only`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    bearing_deviation: float = Field(default=0.05, gt=0.0, description="noise of each bearing, rad")
    process_psd: float = Field(
        default=0.1, ge=0.0, description="spectral density of the acceleration that filters assume, each axis"
    )
    position_variance: float = Field(default=0.1, gt=0.0, description="that filters start from, each axis")
    velocity_variance: float = Field(default=10.0, gt=0.0, description="that filters start from, each axis")
    turn_deviation: float = Field(default=0.01, ge=0.0, description="noise of the rate of turn, rad/s")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """What filters think; `truth` is the target that turns."""
    import numpy as np

    P, V = parameters.position_variance, parameters.velocity_variance
    model = partial(
        DiscreteSystem,
        observe=_bearings,
        measurement_cov=parameters.bearing_deviation**2 * np.eye(2),
        interval=parameters.interval,
    )
    truth = model(
        transition=_turning,
        process_cov=np.array([[parameters.turn_deviation**2]]),
        initial=Moments(mean=np.array(START), cov=np.zeros((4, 4))),
    )
    wiener = np.array([[STEP**3 / 3, STEP**2 / 2], [STEP**2 / 2, STEP]])
    return model(
        transition=_straight,
        process_cov=parameters.process_psd * np.kron(wiener, np.eye(2)),
        initial=Moments(mean=np.zeros(4), cov=np.diag([P, P, V, V])),
        truth=truth,
        residual=_residual,
        coordinates=tuple(map(Coordinate, ("x", "y", "x_rate", "y_rate"), ("", "", "1/s", "1/s"))),
        diverged=_diverged,
        clip=(1.0, 1.0, 5.0, 5.0),
        norms={"position": (0, 1), "velocity": (2, 3)},
    )


def _straight(k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    return jnp.concatenate([x[:2] + STEP * x[2:], x[2:]]) + w


def _turning(k: Any, x: Any, w: Any) -> Any:
    """The exact motion over a step at a constant rate of turn, to the right."""
    import jax.numpy as jnp

    due = sum(((k >= first - 1) & (k < last)) * 1.0 for first, last in TURNS)
    angle = due * (TURN_RATE + w[0]) * STEP
    # Per unit speed, half the angle to the right of the velocity.
    chord = jnp.sinc(angle / (2 * math.pi)) * STEP
    return jnp.concatenate([x[:2] + chord * _turned(x[2:], angle / 2), _turned(x[2:], angle)])


def _turned(v: Any, angle: Any) -> Any:
    """v (2,), turned to the right."""
    import jax.numpy as jnp

    c, s = jnp.cos(angle), jnp.sin(angle)
    return jnp.stack([c * v[0] + s * v[1], c * v[1] - s * v[0]])


def _bearings(k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    return jnp.stack([jnp.arctan2(x[1] - y, x[0] - X) for X, y in SENSORS]) + v


def _residual(y: Any, h: Any) -> Any:
    """y - h (2,), each in [-pi, pi]."""
    from nlbench.orbit import wrapped

    return wrapped(y - h)


def _diverged(error: Any) -> Any:
    return error[0] ** 2 + error[1] ** 2 > LOST**2
