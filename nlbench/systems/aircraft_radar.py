"""An aircraft with drag, tracked by a radar whose noise grows with range (Athans 2001, "Aircraft Tracking").

  dp/dt = v,   dv/dt = (u - (C/2) rho0 exp(-z/H) |v|^2) v/|v|                              drag printed in words
  R = sqrt(x^2 + y^2 + z^2),  azimuth = atan2(y, x),  elevation = atan2(z, sqrt(x^2 + y^2)) printed
State p = (x, y, z), v in metres and seconds, in axes fixed at the radar, z up; the ground is flat. It is in the
benchmark because it joins nonlinear dynamics, nonlinear measurements, known inputs and noise that depends on the state.

The source prints the measurements, "exponential atmosphere, quadratic-in-speed drag forces", and that "typically noise
variance increases with range". All else is chosen:
  motion       an airliner that comes in from 151 km at 240 m/s and 10 km height, sinking 5 m/s, and passes the radar
               at 20 km. Lift balances weight. C = (drag coefficient)(area)/(mass) = 5e-5 m^2/kg; rho0 = 1.225 kg/m^3
               and H = 8500 m of the atmosphere
  known input  the engines' thrust per mass u: .544 m/s^2, which balances the drag at the start, to step 40, then none
  unknown      accelerations of standard deviation .5 m/s^2 level and .1 m/s^2 vertical, constant over a step
  radar        one scan every 10 s, 60 of them; standard deviations 100 m, 1 degree and 1 degree, those of long waves,
               times sqrt(1 + (R/100 km)^4): a floor, and the part that comes of an echo's power falling as R^-4
  start        standard deviations 2, 2, 1 km and 30, 30, 5 m/s
A transition is one RK4 step of 10 s with u constant, to which the unknown acceleration w adds T^2 w/2 and T w.
Diverged (chosen): a position error above 100 km.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "an aircraft with drag, tracked by a radar whose noise grows with range (Athans 2001)"
TIME = "discrete"

SCAN = 10.0  # s
MEAN = (-150e3, 20e3, 10e3, 240.0, 0.0, -5.0)  # m, m/s
DEVIATION = (2e3, 2e3, 1e3, 30.0, 30.0, 5.0)
DENSITY, SCALE_HEIGHT = 1.225, 8500.0  # kg/m^3, m
LOST = 100e3  # m


class Parameters(BaseModel):
    """Parameters of `aircraft-radar`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    range_deviation: float = Field(default=100.0, gt=0.0, description="noise of range close by, m")
    angle_deviation: float = Field(default=1.0, gt=0.0, description="noise of both angles close by, degrees")
    noise_range: float | None = Field(
        default=100e3, gt=0.0, description="range at which noise variances have doubled, m; null: nowhere"
    )
    drag_area: float = Field(default=5e-5, ge=0.0, description="drag coefficient times area per mass, m^2/kg")
    thrust: float = Field(default=0.544, ge=0.0, description="thrust per mass while the engines run, m/s^2")
    thrust_steps: int = Field(
        default=40, ge=0, le=1_000_000_000, description="steps for which the engines run"
    )
    level_acceleration: float = Field(default=0.5, ge=0.0, description="unknown, level, on each axis, m/s^2")
    vertical_acceleration: float = Field(default=0.1, ge=0.0, description="unknown, vertical, m/s^2")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    import numpy as np

    from nlbench.systems.radar import residual

    level, vertical = parameters.level_acceleration**2, parameters.vertical_acceleration**2
    angle = math.radians(parameters.angle_deviation) ** 2
    return DiscreteSystem(
        transition=partial(_transition, parameters.drag_area),
        observe=partial(_observe, parameters.noise_range),
        process_cov=np.diag([level, level, vertical]),
        measurement_cov=np.diag([parameters.range_deviation**2, angle, angle]),
        initial=Moments(mean=np.array(MEAN), cov=np.diag(np.square(DEVIATION))),
        residual=residual,
        inputs=partial(_thrust, parameters.thrust, parameters.thrust_steps),
        coordinates=tuple(Coordinate(name, "m") for name in ("x", "y", "z"))
        + tuple(Coordinate(f"{name}_rate", "m/s") for name in ("x", "y", "z")),
        diverged=_diverged,
        clip=(10e3,) * 3 + (100.0,) * 3,
        norms={"position": (0, 1, 2), "velocity": (3, 4, 5)},
        interval=parameters.interval,
    )


def _transition(drag_area: float, k: Any, x: Any, w: Any, thrust: Any) -> Any:
    import jax.numpy as jnp

    from nlbench.systems.runge_kutta import step

    def rate(x: Any) -> Any:
        velocity = x[3:]
        speed = jnp.sqrt(velocity @ velocity)
        density = DENSITY * jnp.exp(-x[2] / SCALE_HEIGHT)
        forward = thrust - 0.5 * drag_area * density * speed**2
        return jnp.concatenate([velocity, forward / speed * velocity])

    return step(rate, x, SCAN) + jnp.concatenate([SCAN**2 / 2 * w, SCAN * w])


def _observe(noise_range: float | None, k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    from nlbench.systems.radar import range_azimuth_elevation

    seen = range_azimuth_elevation(x[:3])
    factor = 1.0 if noise_range is None else jnp.sqrt(1.0 + (seen[0] / noise_range) ** 4)
    return seen + factor * v


def _thrust(thrust: float, steps: int, k: Any) -> Any:
    import jax.numpy as jnp

    return jnp.where(k < steps, thrust, 0.0)


def _diverged(error: Any) -> Any:
    return error[0] ** 2 + error[1] ** 2 + error[2] ** 2 > LOST**2
