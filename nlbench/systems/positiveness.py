"""A signal and its square, for which the erroneous truncated filter predicts a negative variance (Henriksen 1980).

  x1(k+1) = a x1(k) + w1(k),   x2(k+1) = x1(k)^2 + w2(k),   y(k) = x2(k) + v(k)            chosen
x1 is a signal about zero, x2 what a square-law detector shows of it one step later, with noise of its own. It is in the
benchmark because the loss is certain, at every step, and only in x2: by symmetry a linear filter's estimate of x1 stays
0, its variance P that of the signal, 1. There f_x = 0 and f_xx = 2 for x2, so its variance is predicted as
  Q2 - (f_xx P)^2/4 = Q2 - 1   with the term that Henriksen finds in error, of (11): negative
  Q2                           without it, (19)
  Q2 + (f_xx P)^2/2 = Q2 + 2   for a Gaussian: the truth, the variance of the square of N(0, 1)

The source prints the equations and that the term "may force some of the diagonal terms to be negative", after Andrade
Netto et al. 1976. Example and numbers are chosen: a = .8 and Var w1 = 1 - a^2, so that the signal's variance is 1
always; Q2 = Var w2 = .1; and Var v = 2, that of the squared signal. x1(0) ~ N(0, 1), x2(0) ~ N(1, 2.1), independent.
Diverged (chosen): an error in x2 above 100.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Coordinate

SUMMARY = "a signal and its square: a truncated filter loses a positive variance (after Henriksen 1980)"
TIME = "discrete"


class Parameters(BaseModel):
    """Parameters of `positiveness`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    coefficient: float = Field(default=0.8, gt=-1.0, lt=1.0, description="a, of the signal")
    detector_variance: float = Field(default=0.1, ge=0.0, description="Q2, noise of the square")
    measurement_variance: float = Field(default=2.0, gt=0.0, description="variance of the measurement noise")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    detector = parameters.detector_variance
    return DiscreteSystem(
        transition=partial(_transition, parameters.coefficient),
        observe=_observe,
        process_cov=[[1.0 - parameters.coefficient**2, 0.0], [0.0, detector]],
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(mean=[0.0, 1.0], cov=[[1.0, 0.0], [0.0, 2.0 + detector]]),
        coordinates=(Coordinate("signal"), Coordinate("square")),
        diverged=_diverged,
        clip=(5.0, 10.0),
        interval=parameters.interval,
    )


def _transition(a: float, k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    return jnp.stack([a * x[0], x[0] ** 2]) + w


def _observe(k: Any, x: Any, v: Any) -> Any:
    return x[1:] + v


def _diverged(error: Any) -> Any:
    return abs(error[1]) > 100.0
