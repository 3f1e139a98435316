"""Noise that grows with the state: an autoregression whose disturbance depends on its level (Henriksen 1980, (1)-(2)).

  x(k+1) = a x(k) + G(x(k)) w(k),   G(x) = sqrt(b0 + b1 x^2),   y(k) = x(k) + v(k)         form G(x) w printed
It is in the benchmark because f and h are linear: filters differ in what they make of G alone. To second order
  E G(x)^2 = G^2 + (G'^2 + G G'') P = b0 + b1 m^2 + b1 P,   the covariance G V G' + Q1 + Q2 of (19),
which is exact for this G, while linearisation has b0 + b1 m^2 and G' alone adds G'^2 P < b1 P.

The source prints the form only, and the filter with its terms in G' and G''. The system and its numbers are chosen: it
is an autoregression with conditional heteroscedasticity (Engle 1982; Weiss 1984), as econometrics uses it, with a = .5,
b0 = 1, b1 = .3, w of variance 1: stationary variance b0/(1 - a^2 - b1) = 2.2 and a finite fourth moment, since
a^4 + 6 a^2 b1 + 3 b1^2 = .78 < 1. The noise of a measurement has variance 2, near that of the state; x(0) ~ N(0, 2).
Diverged (chosen): an error above 20.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.exact import PointMass
from nlbench.systems.system import Coordinate

SUMMARY = "an autoregression whose disturbance grows with its level (form: Henriksen 1980)"
TIME = "discrete"

INITIAL_VARIANCE = 2.0


class Parameters(BaseModel):
    """Parameters of `state-dependent-noise`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    coefficient: float = Field(default=0.5, gt=-1.0, lt=1.0, description="a, of the autoregression")
    base: float = Field(default=1.0, gt=0.0, description="b0, variance of the disturbance at x = 0")
    growth: float = Field(default=0.3, ge=0.0, description="b1, its growth with x^2")
    measurement_variance: float = Field(default=2.0, gt=0.0, description="variance of the measurement noise")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    return DiscreteSystem(
        transition=partial(_transition, parameters.coefficient, parameters.base, parameters.growth),
        observe=_observe,
        process_cov=[[1.0]],
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(mean=[0.0], cov=[[INITIAL_VARIANCE]]),
        coordinates=(Coordinate("x"),),
        diverged=_diverged,
        clip=(5.0,),
        interval=parameters.interval,
        exact=PointMass((-60.0,), (60.0,), (241,)),  # half the least noise apart; tails are heavy
    )


def _transition(a: float, base: float, growth: float, k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    return a * x + jnp.sqrt(base + growth * x**2) * w


def _observe(k: Any, x: Any, v: Any) -> Any:
    return x + v


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 20.0
