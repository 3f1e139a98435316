"""A level under known inputs, seen by a sensor whose local slopes mislead (Athans 2001, "Problems with Taylor
Expansions").

  x(k+1) = a x(k) + u(k) + w(k),   u(k) = U sin(2 pi k/T)                                  chosen
  z(k) = x(k) + A sin(2 pi x(k)/L) + v(k)                                                  chosen
The sensor follows a straight line but for ripples, with slopes 1 + (2 pi A/L) cos(2 pi x/L) of either sign. It is in
the benchmark because whoever expands the measurement at a point, to first or second order, takes the ripple for the
sensor: the source advises "a straight line" for h(x), with "slightly" more noise. By how much more: a ripple that is
passed at all phases alike adds the variance A^2/2. In a filter's `model` that line is `ripple: 0` with R + A^2/2.

The source draws such a sensor and gives neither system nor numbers; it has known inputs u in (1) and no example of
them. Chosen: a = .95, Var w = .1, and U = 1 with T = 20, which swings the state by +-3.2 about 0, so that all phases
are passed; A = .5 and L = 1, slopes from -2.1 to 4.1 within half a unit, where a filter's own deviation is about a
third; Var v = .04. x(0) ~ N(0, 1), about the stationary variance Var w/(1 - a^2). Without dimensions.
Diverged (chosen): an error above 20.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.exact import PointMass
from nlbench.systems.system import Coordinate

SUMMARY = "a level under known inputs, seen by a sensor with misleading slopes (after Athans 2001)"
TIME = "discrete"

INITIAL_VARIANCE = 1.0
GRID = PointMass(
    lower=(-12.0,), upper=(12.0,), points=(1201,)
)  # two points in Var v^.5 over the steepest slope


class Parameters(BaseModel):
    """Parameters of `rippled-sensor`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    coefficient: float = Field(default=0.95, gt=-1.0, lt=1.0, description="a, of the level")
    input_amplitude: float = Field(default=1.0, description="U, of the known input")
    input_period: float = Field(default=20.0, gt=0.0, description="T, of the known input, steps")
    ripple: float = Field(default=0.5, description="A, how far the sensor is off its line")
    wavelength: float = Field(default=1.0, gt=0.0, description="L, of the ripple")
    process_variance: float = Field(default=0.1, gt=0.0, description="variance of w")
    measurement_variance: float = Field(default=0.04, gt=0.0, description="variance of v")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    return DiscreteSystem(
        transition=partial(_transition, parameters.coefficient),
        observe=partial(_observe, parameters.ripple, 2 * math.pi / parameters.wavelength),
        process_cov=[[parameters.process_variance]],
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(mean=[0.0], cov=[[INITIAL_VARIANCE]]),
        inputs=partial(_input, parameters.input_amplitude, 2 * math.pi / parameters.input_period),
        coordinates=(Coordinate("x"),),
        diverged=_diverged,
        clip=(5.0,),
        interval=parameters.interval,
        exact=GRID,
    )


def _transition(a: float, k: Any, x: Any, w: Any, u: Any) -> Any:
    return a * x + u + w


def _observe(ripple: float, wavenumber: float, k: Any, x: Any, v: Any) -> Any:
    import jax.numpy as jnp

    return x + ripple * jnp.sin(wavenumber * x) + v


def _input(amplitude: float, frequency: float, k: Any) -> Any:
    import jax.numpy as jnp

    return amplitude * jnp.sin(frequency * k)


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 20.0
