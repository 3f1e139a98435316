"""A vehicle enters the atmosphere, its drag unknown, and a radar on the ground sees it (Julier and Uhlmann 2004).

  p' = v,   v' = D v + G p + noise,   x5' = noise                                          printed
  D = -.59783 exp(x5) exp((R0 - |p|)/13.406) |v|,   G = -3.986e5/|p|^3
  range = |p - s|,   angle = atan2(p2 - s2, p1 - s1),   s = (R0, 0),   R0 = 6374           printed
State p, v in kilometers and seconds, in a plane through the center of the earth, and x5, the logarithm of a factor of
the drag. It is in the benchmark because it is nonlinear in every part and yet so well measured that all filters agree.

Numbers are those of Hartikainen, Solin and Sarkka 2011 (table 3.4), with the corrections of Julier and Uhlmann:
Euler steps of .1 s, 2,000 of them, a measurement after each; per step process noise of variance 2.4064e-5 on each
velocity and, for filters only, 1e-6 on x5; noise of 1 m and .17 mrad; truth from N(m0, 1e-6 I) but x5 = .6932 exactly,
filters from m0 with x5 = 0 and variance 1 of it (printed).
Diverged (chosen): a position error above 100 km.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "a re-entry vehicle with unknown drag, tracked by radar (Julier and Uhlmann 2004)"
TIME = "discrete"

STEP = 0.1  # s
BETA, HEIGHT, GRAVITY, EARTH = -0.59783, 13.406, 3.9860e5, 6374.0  # 1/km, km, km^3/s^2, km
MEAN = (6500.4, 349.14, -1.8093, -6.7967)  # km, km/s
VARIANCE = 1e-6  # of each of them
DRAG = 0.6932  # the true x5
LOST = 100.0  # km


class Parameters(BaseModel):
    """Parameters of `re-entry`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    range_deviation: float = Field(default=1e-3, gt=0.0, description="noise of the range, km")
    angle_deviation: float = Field(default=0.17e-3, gt=0.0, description="noise of the angle, rad")
    process_variance: float = Field(
        default=2.4064e-5, ge=0.0, description="of each velocity's noise, per step, km^2/s^2"
    )
    drag_process_variance: float = Field(
        default=1e-6, ge=0.0, description="of the noise that filters assume on x5, per step"
    )
    drag_variance: float = Field(default=1.0, gt=0.0, description="variance of x5 that filters start from")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """What filters think; `truth` has the constant drag that they do not know."""
    import numpy as np

    Q = parameters.process_variance
    model = partial(
        DiscreteSystem,
        transition=_transition,
        observe=_radar,
        measurement_cov=np.diag([parameters.range_deviation**2, parameters.angle_deviation**2]),
        interval=parameters.interval,
    )
    truth = model(
        process_cov=np.diag([Q, Q, 0.0]),
        initial=Moments(mean=np.array([*MEAN, DRAG]), cov=np.diag([VARIANCE] * 4 + [0.0])),
    )
    return model(
        process_cov=np.diag([Q, Q, parameters.drag_process_variance]),
        initial=Moments(
            mean=np.array([*MEAN, 0.0]), cov=np.diag([VARIANCE] * 4 + [parameters.drag_variance])
        ),
        truth=truth,
        residual=_residual,
        coordinates=tuple(
            map(Coordinate, ("x", "y", "x_rate", "y_rate", "drag"), ("km", "km", "km/s", "km/s", ""))
        ),
        diverged=_diverged,
        clip=(1.0, 1.0, 1.0, 1.0, 3.0),
        norms={"position": (0, 1), "velocity": (2, 3)},
    )


def _transition(k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    position, velocity = x[:2], x[2:4]
    distance, speed = jnp.sqrt(position @ position), jnp.sqrt(velocity @ velocity)
    drag = BETA * jnp.exp(x[4]) * jnp.exp((EARTH - distance) / HEIGHT) * speed
    rate = drag * velocity - GRAVITY / distance**3 * position
    return jnp.concatenate([position + STEP * velocity, velocity + STEP * rate + w[:2], x[4:] + w[2:]])


def _radar(k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    ahead, up = x[0] - EARTH, x[1]
    return jnp.stack([jnp.sqrt(ahead**2 + up**2), jnp.arctan2(up, ahead)]) + v


def _residual(y: Any, h: Any) -> Any:
    """y - h (2,), that of the angle in [-pi, pi]."""
    from nlbench.orbit import wrapped

    difference = y - h
    return difference.at[1].set(wrapped(difference[1]))


def _diverged(error: Any) -> Any:
    return error[0] ** 2 + error[1] ** 2 > LOST**2
