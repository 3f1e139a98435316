"""A damped oscillator whose damping ratio is to be identified (Culver 1969, sections 8.1 and 8.2).

  x1' = x2,   x2' = -omega^2 x1 - 2 omega x2 x3 + G v,   x3' = 0,   0 to 10 s              (8.5), printed
  y = (x1, x2) + noise of covariance R I                                                   (8.11)-(8.12), printed
x1 is the position, x2 the velocity, x3 the damping ratio; time in seconds, omega = 1 (printed). It is in the benchmark
because its nonlinearity, the product x2 x3, is that of every linear system with an unknown coefficient, and because the
exact posterior is known: given x3 the system is linear and Gaussian.

Mean (10, 0, .5) and covariance diag(9, 9, P33) at the start are printed, with P33 = .16 in figures 8.1-8.6 and
8.10-8.12 and .09 in 8.7-8.9; so are R = 50 every .2 s (8.4-8.9) and R = 10 every 1 s (8.10-8.12), and the Runge-Kutta
step of .05 s. Process noise is in (8.5) but in no printed simulation: G = 0 (chosen).

The printed damping ratio is normal, and 11 % of its draws (for P33 = .16) are negative: unstable. Ensembles differ in
how it is drawn; position and velocity are always normal:
  matched      .5 + sqrt(P33/.16) d, with the bounded d of `ensembles` (default; chosen): variance P33,
               between -.34 and 1.34 for P33 = .16
  normal       N(.5, P33), as printed
  thesis-sets  sets of 20 or 10, sample means and variances corrected (printed, section 8.2)
Diverged (chosen): an error above 3 in damping or 100 in position, from the first such report time on.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.ensembles import (
    MATCHED_BOUND,
    MATCHED_DEVIATION,
    MATCHED_VARIANCE,
    corrected,
    matched,
    normal_nodes,
)
from nlbench.systems.exact import KalmanBank
from nlbench.systems.system import Coordinate, Sets, System

SUMMARY = "a damped oscillator with unknown damping ratio (Culver 1969, section 8.2)"

POSITION, VELOCITY, DAMPING = 10.0, 0.0, 0.5
VARIANCE = 9.0  # of position and of velocity
GRID_POINTS = 128  # of the damping ratio, where it is bounded
WIDE_GRID_POINTS, GRID_REACH = 256, 6.0  # where it is normal, and how many standard deviations are covered


class Parameters(BaseModel):
    """Parameters of `oscillator`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    ensemble: Literal["matched", "normal", "thesis-sets"] = Field(
        default="matched", description="how damping ratios are drawn"
    )
    set_size: int = Field(default=20, ge=2, le=1000, description="runs in a set, for thesis-sets")
    damping_variance: float = Field(default=0.16, gt=0.0, description="variance of the damping ratio")
    measurement: Literal["none", "linear"] = Field(
        default="linear", description="position and velocity, or nothing"
    )
    interval: float = Field(default=0.2, gt=0.0, description="time between measurements, s")
    measurement_variance: float = Field(
        default=50.0, gt=0.0, description="variance of each measurement's noise"
    )
    process_variance: float = Field(
        default=0.0, ge=0.0, description="spectral density G^2 of the process noise"
    )


def build(parameters: Parameters) -> System:
    """The system with the given parameters."""
    noise = parameters.process_variance
    return System(
        drift=_drift,
        observe=_position_and_velocity,
        measurement_cov=[[parameters.measurement_variance, 0.0], [0.0, parameters.measurement_variance]],
        initial=Moments(
            mean=[POSITION, VELOCITY, DAMPING],
            cov=[[VARIANCE, 0.0, 0.0], [0.0, VARIANCE, 0.0], [0.0, 0.0, parameters.damping_variance]],
        ),
        diffusion=_into_velocity if noise > 0.0 else None,
        diffusion_cov=[[noise]] if noise > 0.0 else None,
        sample=_sampler(parameters),
        coordinates=(Coordinate("position"), Coordinate("velocity"), Coordinate("damping")),
        diverged=_diverged,
        diverged_stays=True,
        clip=(10.0, 10.0, 1.0),
        interval=None if parameters.measurement == "none" else parameters.interval,
        step=0.05,
        exact=_bank(parameters),
    )


def _drift(t: Any, x: Any) -> Any:
    position, velocity, damping = x
    return velocity, -position - 2.0 * velocity * damping, 0.0


def _position_and_velocity(t: Any, x: Any) -> Any:
    return x[:2]


def _into_velocity(t: Any, x: Any) -> Any:
    import numpy as np

    return np.array([[0.0], [1.0], [0.0]])


def _diverged(error: Any) -> Any:
    return (abs(error[2]) > 3.0) | (abs(error[0]) > 100.0)


def _sampler(parameters: Parameters) -> Any:
    """How the initial state is drawn: key -> (3,), or sets."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    mean = np.array([POSITION, VELOCITY, DAMPING])
    deviation = np.sqrt([VARIANCE, VARIANCE, parameters.damping_variance])
    if parameters.ensemble == "thesis-sets":
        return Sets(parameters.set_size, lambda normals: mean + deviation * corrected(normals))
    if parameters.ensemble == "normal":
        return lambda key: mean + deviation * jax.random.normal(key, (3,))

    def sample(key: Any) -> Any:
        of_motion, of_damping = jax.random.split(key)
        d = matched(of_damping, (1,)) / math.sqrt(MATCHED_VARIANCE)
        return mean + deviation * jnp.concatenate([jax.random.normal(of_motion, (2,)), d])

    return sample


def _bank(parameters: Parameters) -> KalmanBank:
    """A Kalman filter for each of a grid of damping ratios, over the support of the ensemble."""
    import numpy as np

    scale = math.sqrt(parameters.damping_variance)
    reach, spread, count = GRID_REACH * scale, scale, WIDE_GRID_POINTS
    if parameters.ensemble == "matched":
        scale /= math.sqrt(MATCHED_VARIANCE)
        reach, spread, count = MATCHED_BOUND * scale, MATCHED_DEVIATION * scale, GRID_POINTS
    nodes, weights = normal_nodes(DAMPING - reach, DAMPING + reach, DAMPING, spread, count)
    drift = np.tile([[0.0, 1.0], [-1.0, 0.0]], (count, 1, 1))
    drift[:, 1, 1] = -2.0 * nodes
    noise = parameters.process_variance
    return KalmanBank(
        nodes,
        weights,
        mean=np.array([POSITION, VELOCITY]),
        cov=VARIANCE * np.eye(2),
        drift=drift,
        spectrum=np.diag([0.0, noise]) if noise > 0.0 else None,
    )
