"""A submarine tracked by sonar, passive (bearing) or active (range and bearing) (Athans 2001, "Submarine Tracking").

  p(k+1) = p(k) + T v(k) + T^2 w(k)/2 - u(k),   v(k+1) = v(k) + T w(k)                    chosen
  bearing = atan2(y, x),   R = sqrt(x^2 + y^2)                                             printed
State p = (x, y), where the submarine is from the own ship, and v, its velocity, in metres and seconds; w an unknown
acceleration, u(k) the known way of the own ship in step k. It is in the benchmark because the range is not measured by
passive sonar: only the own ship's turns show it, and until then its uncertainty is large against the curvature of the
bearing.

The source prints the measurements and that "variance of sensor noise may depend on range". All else is chosen:
  motion       the submarine is about 10 km off on the x axis and goes at some 5 m/s, straight but for accelerations of
               standard deviation .003 m/s^2, constant over a step T = 30 s
  own ship     5 m/s, 60 degrees to the left of the x axis and to the right in turn, 20 steps each: zigzag across the
               line of sight; 60 steps are half an hour
  sonar        bearing 1 degree, range 100 m, close by. Variances grow as the power of sound falls: bearings only, by
               1 + (R/10 km)^2; with echoes, which go both ways, by 1 + (R/10 km)^4
  start        mean (10, 0) km and (-3, 4) m/s; standard deviations 2 km along the line of sight, 1 km across it, 3 m/s
Diverged (chosen): a position error above 20 km, twice the distance at the start.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "a submarine tracked by bearings, or by ranges and bearings (Athans 2001)"
TIME = "discrete"

STEP = 30.0  # s
MEAN = (10e3, 0.0, -3.0, 4.0)  # m, m/s
DEVIATION = (2e3, 1e3, 3.0, 3.0)
LOST = 20e3  # m


class Parameters(BaseModel):
    """Parameters of `submarine`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    measurement: Literal["bearing", "range-and-bearing"] = Field(
        default="bearing", description="what the sonar tells"
    )
    bearing_deviation: float = Field(default=1.0, gt=0.0, description="noise of bearings close by, degrees")
    range_deviation: float = Field(default=100.0, gt=0.0, description="noise of ranges close by, m")
    noise_range: float | None = Field(
        default=10e3, gt=0.0, description="range at which noise variances have doubled, m; null: nowhere"
    )
    acceleration: float = Field(
        default=0.003, ge=0.0, description="unknown, of the submarine, on each axis, m/s^2"
    )
    own_speed: float = Field(default=5.0, ge=0.0, description="speed of the own ship, m/s")
    own_course: float = Field(
        default=60.0, ge=-180.0, le=180.0, description="of its legs to the x axis, + and - in turn, degrees"
    )
    leg: int = Field(
        default=20, ge=1, le=1_000_000_000, description="steps from one turn of the own ship to the next"
    )
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    import numpy as np

    active = parameters.measurement == "range-and-bearing"
    bearing = math.radians(parameters.bearing_deviation) ** 2
    return DiscreteSystem(
        transition=_transition,
        observe=partial(_range_and_bearing if active else _bearing, parameters.noise_range),
        process_cov=parameters.acceleration**2 * np.eye(2),
        measurement_cov=np.diag([parameters.range_deviation**2, bearing] if active else [bearing]),
        initial=Moments(mean=np.array(MEAN), cov=np.diag(np.square(DEVIATION))),
        residual=_residual,
        inputs=partial(_own_way, parameters),
        coordinates=(
            Coordinate("x", "m"),
            Coordinate("y", "m"),
            Coordinate("x_rate", "m/s"),
            Coordinate("y_rate", "m/s"),
        ),
        diverged=_diverged,
        clip=(5e3, 5e3, 5.0, 5.0),
        norms={"position": (0, 1), "velocity": (2, 3)},
        interval=parameters.interval,
    )


def _transition(k: Any, x: Any, w: Any, way: Any) -> Any:
    import jax.numpy as jnp

    position, velocity = x[:2], x[2:]
    return jnp.concatenate([position + STEP * velocity + STEP**2 / 2 * w - way, velocity + STEP * w])


def _own_way(parameters: Parameters, k: Any) -> Any:
    """u(k): (2,), in metres."""
    import jax.numpy as jnp

    course = math.radians(parameters.own_course)
    way = parameters.own_speed * STEP
    left = jnp.where(k // parameters.leg % 2 == 0, 1.0, -1.0)
    return jnp.stack([jnp.full_like(left, way * math.cos(course)), left * way * math.sin(course)])


def _bearing(noise_range: float | None, k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    return jnp.arctan2(x[1:2], x[:1]) + _growth(noise_range, x, 2) * v


def _range_and_bearing(noise_range: float | None, k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    away = jnp.sqrt(x[0] ** 2 + x[1] ** 2)
    return jnp.stack([away, jnp.arctan2(x[1], x[0])]) + _growth(noise_range, x, 4) * v


def _growth(noise_range: float | None, x: Any, power: int) -> Any:
    """By what the standard deviation of the noise is multiplied."""
    import jax.numpy as jnp

    if noise_range is None:
        return 1.0
    return jnp.sqrt(1.0 + ((x[0] ** 2 + x[1] ** 2) / noise_range**2) ** (power // 2))


def _residual(y: Any, h: Any) -> Any:
    """y - h (m,); that of the bearing, which comes last, in [-pi, pi]."""
    from nlbench.orbit import wrapped

    difference = y - h
    return difference.at[-1].set(wrapped(difference[-1]))


def _diverged(error: Any) -> Any:
    return error[0] ** 2 + error[1] ** 2 > LOST**2
