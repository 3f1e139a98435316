"""A first-order linear system whose coefficient is to be identified (Athans 2001, "On-Line Parameter Estimation").

  x1(k+1) = x1(k) x2(k) + xi(k),   x2(k+1) = x2(k),   z(k) = x1(k) + theta(k)              printed
x1 is the state, x2 its unknown coefficient a. It is in the benchmark because the product is the simplest nonlinearity
that matters in practice, and because the exact posterior is known: given a the system is linear and Gaussian.

The source prints no numbers. Chosen: of a little more is known than that it is between 0 and 1, mean .5 and standard
deviation .23; xi and theta have variance 1, so that the state is seen about as well as it is disturbed; x1(0) ~
N(0, 4/3), stationary for a = .5. Ensembles differ in how a is drawn:
  matched      .5 + (.23/.4) d, with the bounded d of `ensembles` (default): between .017 and .983, so that every run is
               stable
  normal       N(.5, .23^2), of which 1.5 % are above 1: unstable
Diverged (chosen): an error above 3 in the coefficient or 100 in the state.
"""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.ensembles import (
    MATCHED_BOUND,
    MATCHED_DEVIATION,
    MATCHED_VARIANCE,
    matched,
    normal_nodes,
)
from nlbench.systems.exact import ParameterBank
from nlbench.systems.system import Coordinate

SUMMARY = "a first-order system with unknown coefficient (Athans 2001)"
TIME = "discrete"

STATE_VARIANCE = 4 / 3
GRID_POINTS = 128  # of the coefficient, where it is bounded
WIDE_GRID_POINTS, GRID_REACH = 256, 6.0  # where it is normal, and how many standard deviations are covered


class Parameters(BaseModel):
    """Parameters of `parameter-identification`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    ensemble: Literal["matched", "normal"] = Field(
        default="matched", description="how coefficients are drawn"
    )
    coefficient_mean: float = Field(default=0.5, description="mean of the coefficient")
    coefficient_deviation: float = Field(
        default=0.23, gt=0.0, description="standard deviation of the coefficient"
    )
    process_variance: float = Field(default=1.0, gt=0.0, description="variance of xi")
    measurement_variance: float = Field(default=1.0, gt=0.0, description="variance of theta")
    interval: int = Field(default=1, ge=1, le=1_000_000_000, description="steps between measurements")


def build(parameters: Parameters) -> DiscreteSystem:
    """The system with the given parameters."""
    return DiscreteSystem(
        transition=_transition,
        observe=_observe,
        process_cov=[[parameters.process_variance]],
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(
            mean=[0.0, parameters.coefficient_mean],
            cov=[[STATE_VARIANCE, 0.0], [0.0, parameters.coefficient_deviation**2]],
        ),
        sample=_sampler(parameters) if parameters.ensemble == "matched" else None,
        coordinates=(Coordinate("state"), Coordinate("coefficient")),
        diverged=_diverged,
        clip=(10.0, 1.0),
        interval=parameters.interval,
        exact=_bank(parameters),
    )


def _transition(k: Any, x: Any, w: Any) -> Any:
    import jax.numpy as jnp

    return jnp.stack([x[0] * x[1] + w[0], x[1]])


def _observe(k: Any, x: Any, v: Any) -> Any:
    return x[:1] + v


def _diverged(error: Any) -> Any:
    return (abs(error[1]) > 3.0) | (abs(error[0]) > 100.0)


def _sampler(parameters: Parameters) -> Any:
    """How the initial state is drawn, the coefficient bounded: key -> (2,)."""
    import jax
    import jax.numpy as jnp

    scale = parameters.coefficient_deviation / math.sqrt(MATCHED_VARIANCE)

    def sample(key: Any) -> Any:
        of_state, of_coefficient = jax.random.split(key)
        state = math.sqrt(STATE_VARIANCE) * jax.random.normal(of_state, (1,))
        return jnp.concatenate([state, parameters.coefficient_mean + scale * matched(of_coefficient, (1,))])

    return sample


def _bank(parameters: Parameters) -> ParameterBank:
    """A Kalman filter for each of a grid of coefficients, over the support of the ensemble."""
    mean, scale = parameters.coefficient_mean, parameters.coefficient_deviation
    reach, spread, count = GRID_REACH * scale, scale, WIDE_GRID_POINTS
    if parameters.ensemble == "matched":
        scale /= math.sqrt(MATCHED_VARIANCE)
        reach, spread, count = MATCHED_BOUND * scale, MATCHED_DEVIATION * scale, GRID_POINTS
    nodes, weights = normal_nodes(mean - reach, mean + reach, mean, spread, count)
    return ParameterBank(nodes, weights, mean=[0.0], cov=[[STATE_VARIANCE]])
