"""The univariate nonstationary growth model (Netto, Gimeno and Mendes 1978; Gordon, Salmond and Smith 1993).

  x(k+1) = x/2 + 25 x/(1 + x^2) + 8 cos(1.2 k) + w(k),   y(k) = x(k)^2/20 + v(k)           printed
with w and v of variance 1. It is in the benchmark because the square hides the sign of x: the posterior often has two
modes, which no Gaussian filter can hold, and because it is scalar, so that the exact posterior is a sum over a grid.

Numbers are those of Hartikainen, Solin and Sarkka 2011 (table 3.2): truth
from .1 exactly, filters from mean .1 and variance 1, 500 steps (printed). The cosine is of the step's start, k = 0 at
the first (printed there as n - 1). Without dimensions.
Diverged (chosen): an error above 10,000. The signal stays within 30 or so; an EKF errs by hundreds now and then, which
is its performance here, not its end. A second-order filter goes beyond any bound.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.exact import PointMass
from nlbench.systems.system import Coordinate

SUMMARY = "univariate nonstationary growth, seen squared (Gordon, Salmond and Smith 1993)"
TIME = "discrete"

START = 0.1
GRID = PointMass(lower=(-40.0,), upper=(40.0,), points=(1201,))  # the mean then errs by 4e-5 of the RMS error


class Parameters(BaseModel):
    """Parameters of `ungm`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    process_variance: float = Field(default=1.0, gt=0.0, description="variance of w")
    measurement_variance: float = Field(default=1.0, gt=0.0, description="variance of v")
    initial_variance: float = Field(default=1.0, gt=0.0, description="variance that filters start from")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    return DiscreteSystem(
        transition=_transition,
        observe=_observe,
        process_cov=[[parameters.process_variance]],
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(mean=[START], cov=[[parameters.initial_variance]]),
        sample=_start,
        coordinates=(Coordinate("x"),),
        diverged=_diverged,
        clip=(20.0,),
        interval=parameters.interval,
        exact=GRID,
    )


def _transition(k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    return x / 2 + 25 * x / (1 + x**2) + 8 * jnp.cos(1.2 * k) + w


def _observe(k: Any, x: Any, v: Any) -> Any:
    return x**2 / 20 + v


def _start(key: Any) -> Any:
    """Every run starts at the same state."""
    import jax.numpy as jnp

    return jnp.array([START])


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 10_000.0
