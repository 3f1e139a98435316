"""The cubic sensor: a Wiener process, measured continuously through its cube (Hazewinkel, Marcus and Sussmann 1983).

  dx = dw,   dz = x^3 dt + dv                                                              printed
with w and v of spectral density 1. It is in the benchmark as the classic problem without a finite-dimensional filter
(proved there), where expanding the measurement fails at once: slope and curvature of x^3 are zero at zero, and a filter
that starts there stays there. Scalar, so Zakai's equation can be solved on a grid.

Without dimensions. Chosen, as the literature varies: x(0) ~ N(0, 1), steps of .001. The process reaches +-3 sqrt(1 + t)
or so; the grid covers +-10, 5.8 standard deviations at t = 2.
Diverged (chosen): an error above 20.
"""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.exact import ZakaiGrid
from nlbench.systems.system import Coordinate, System

SUMMARY = "a Wiener process measured through its cube (Hazewinkel, Marcus and Sussmann 1983)"
MEASUREMENT = "continuous"

GRID = ZakaiGrid(lower=-10.0, upper=10.0, points=400)


class Parameters(BaseModel):
    """Parameters of `cubic-sensor`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    process_psd: float = Field(default=1.0, gt=0.0, description="spectral density of the process noise")
    measurement_psd: float = Field(default=1.0, gt=0.0, description="spectral density of the measurement's")
    initial_mean: float = Field(default=0.0, description="mean of the initial state")
    initial_variance: float = Field(default=1.0, gt=0.0, description="variance of the initial state")


def build(parameters: Parameters) -> System:
    """The system with the given parameters."""
    return System(
        drift=_still,
        observe=_cube,
        measurement_cov=[[parameters.measurement_psd]],
        measurement="continuous",
        initial=Moments(mean=[parameters.initial_mean], cov=[[parameters.initial_variance]]),
        diffusion=_unit,
        diffusion_cov=[[parameters.process_psd]],
        coordinates=(Coordinate("x"),),
        diverged=_diverged,
        clip=(3.0,),
        step=0.001,
        exact=GRID,
    )


def _still(t: Any, x: Any) -> Any:
    import jax.numpy as jnp

    return jnp.zeros_like(x)


def _cube(t: Any, x: Any) -> Any:
    return x**3


def _unit(t: Any, x: Any) -> Any:
    import numpy as np

    return np.eye(1)


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 20.0
