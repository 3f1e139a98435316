"""A satellite tracked by one or two radars on the ground (Athans 2001, "Satellite Tracking").

  dp/dt = v,   dv/dt = -mu p/|p|^3                                                        inverse-square law, printed
  range, azimuth and elevation of the satellite from each radar                           printed in words
State p, v in metres and seconds, in axes through the centre of the earth that do not turn, z to the north pole. It is
in the benchmark because the first orbit estimate is poor and the measurements are good: what the curvature of a range
makes of the error across the line of sight is many times its noise.

The source prints the law, "one or more radars measure the range to the satellite, and associated azimuth and elevation
angles", and that they are functions of inertial coordinates. All else is chosen:
  orbit        circular, 700 km high and inclined by 98 degrees, northbound. It rises in the south and passes the first
               radar in the east, 8 minutes in all
  earth        a sphere of radius 6371 km that turns once in a sidereal day; mu = 3.986004418e14 m^3/s^2
  radars       in latitude 42.6 degrees, in the plane of x and z at step 0; the second, if there is one, in latitude 38
               degrees and 10 degrees farther east. Azimuth is from north to east, elevation above the horizon. Standard
               deviations 20 m, .05 degrees and .05 degrees, a measurement every 10 s
  unknown      accelerations of standard deviation .01 m/s^2 on each axis, constant over a step: the size of what the
               oblate earth adds to the inverse-square law
  start        standard deviations 20 km and 20 m/s on each axis, of elements that are some days old
A transition is one RK4 step of 10 s, wrong by less than .1 mm, to which the unknown acceleration adds T^2 w/2 and T w.
Diverged (chosen): a position error above 200 km.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "a satellite tracked by radars on the ground (Athans 2001)"
TIME = "discrete"

STEP = 10.0  # s
MU = 3.986004418e14  # m^3/s^2
EARTH = 6.371e6  # m
TURNING = 7.2921159e-5  # rad/s, of the earth
HEIGHT = 700e3  # m
# Degrees: of the orbit; of the node's longitude; and of the place on the orbit from there.
INCLINATION, NODE, ARGUMENT = 98.0, 15.0, 28.0
RADARS = ((42.6, 0.0), (38.0, 10.0))  # latitude, and longitude from the x axis at step 0, degrees
LOST = 200e3  # m


class Parameters(BaseModel):
    """Parameters of `satellite-radar`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    radars: int = Field(default=1, ge=1, le=2, description="how many radars measure")
    range_deviation: float = Field(default=20.0, gt=0.0, description="noise of ranges, m")
    angle_deviation: float = Field(default=0.05, gt=0.0, description="noise of both angles, degrees")
    acceleration: float = Field(default=0.01, ge=0.0, description="unknown, on each axis, m/s^2")
    position_deviation: float = Field(default=20e3, gt=0.0, description="at the start, on each axis, m")
    velocity_deviation: float = Field(default=20.0, gt=0.0, description="at the start, on each axis, m/s")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    import numpy as np

    from nlbench.systems.radar import residual

    angle = math.radians(parameters.angle_deviation)
    deviation = [parameters.position_deviation] * 3 + [parameters.velocity_deviation] * 3
    return DiscreteSystem(
        transition=_transition,
        observe=partial(_observe, RADARS[: parameters.radars]),
        process_cov=parameters.acceleration**2 * np.eye(3),
        measurement_cov=np.diag(np.square([parameters.range_deviation, angle, angle] * parameters.radars)),
        initial=Moments(mean=_start(), cov=np.diag(np.square(deviation))),
        residual=residual,
        coordinates=tuple(Coordinate(name, "m") for name in ("x", "y", "z"))
        + tuple(Coordinate(f"{name}_rate", "m/s") for name in ("x", "y", "z")),
        diverged=_diverged,
        clip=(20e3,) * 3 + (200.0,) * 3,
        norms={"position": (0, 1, 2), "velocity": (3, 4, 5)},
        interval=parameters.interval,
    )


def _start() -> Any:
    """Position and velocity (6,) at step 0."""
    import numpy as np

    inclination, node, argument = map(math.radians, (INCLINATION, NODE, ARGUMENT))
    radius = EARTH + HEIGHT
    to_node = np.array([math.cos(node), math.sin(node), 0.0])
    ahead = np.array([-math.sin(node), math.cos(node), 0.0]) * math.cos(inclination)
    ahead[2] = math.sin(inclination)  # a quarter of an orbit past the node
    position = math.cos(argument) * to_node + math.sin(argument) * ahead
    direction = math.cos(argument) * ahead - math.sin(argument) * to_node
    return np.concatenate([radius * position, math.sqrt(MU / radius) * direction])


def _transition(k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    from nlbench.systems.runge_kutta import step

    def rate(x: Any) -> Any:
        square = x[:3] @ x[:3]
        return jnp.concatenate([x[3:], -MU / (square * jnp.sqrt(square)) * x[:3]])

    return step(rate, x, STEP) + jnp.concatenate([STEP**2 / 2 * w, STEP * w])


def _observe(radars: tuple[tuple[float, float], ...], k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    from nlbench.systems.radar import range_azimuth_elevation

    seen = []
    for latitude, longitude in radars:
        axes = _local_axes(math.radians(latitude), math.radians(longitude) + TURNING * STEP * k)
        north_east_up = axes @ x[:3] - jnp.array([0.0, 0.0, EARTH])
        seen.append(range_azimuth_elevation(north_east_up))
    return jnp.concatenate(seen) + v


def _local_axes(latitude: float, angle: Any) -> Any:
    """Unit vectors to the north, to the east and up, as rows (3, 3), of a place `angle` east of the x axis."""
    import jax.numpy as jnp

    s, c, sine, cosine = math.sin(latitude), math.cos(latitude), jnp.sin(angle), jnp.cos(angle)
    return jnp.array([[-s * cosine, -s * sine, c], [-sine, cosine, 0.0], [c * cosine, c * sine, s]])


def _diverged(error: Any) -> Any:
    return error[0] ** 2 + error[1] ** 2 + error[2] ** 2 > LOST**2
