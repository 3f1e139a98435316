"""A body falls through the atmosphere and slows down at an unknown rate (Gelb 1974, examples 6.1-2 and 6.1-3).

  x1' = x2,   x2' = rho0 exp(-x1/k) x2^2/(2 x3) - g,   x3' = 0,   0 to 16 s                printed
  6.1-2  y = x1 + noise                                   the radar is below
  6.1-3  y = sqrt(r1^2 + (x1 - r2)^2) + noise             it is r1 = 1000 ft off, r2 = 100 ft high; printed
State x1 the altitude in ft, x2 the velocity in ft/s, x3 the ballistic parameter in lb/ft^2; rho0 = 3.4e-3, k = 22000,
g = 32.2; noise of variance 100 ft^2, a range every .01 s, the integration step too (printed). It is in the benchmark
because the drag, nearly nothing at first, grows sixtyfold with the density on the way down: what a filter leaves out of
its mean, it takes for a wrong ballistic parameter. The example introduces the second-order filter as the cure.

Filters start from (1e5, -6000, 2500) and variances (500, 2e4, 2.5e5), and every true body from (1e5 + 100, -6000 + 350,
2500 + 500) (printed: `initial_error: published`); `gaussian` draws bodies as filters expect them (chosen).
Diverged (chosen): an error above 10,000 ft.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.system import Coordinate, System

SUMMARY = "a body falling through the atmosphere, tracked by radar (Gelb 1974, section 6.1)"

DENSITY, HEIGHT, GRAVITY = 3.4e-3, 22000.0, 32.2  # lb s^2/ft^4, ft, ft/s^2
ASIDE, ABOVE = 1000.0, 100.0  # ft, where the radar of 6.1-3 is
MEAN = (1e5, -6000.0, 2500.0)
VARIANCE = (500.0, 2e4, 2.5e5)
PUBLISHED = (1e5 + 100.0, -6000.0 + 350.0, 2500.0 + 500.0)


class Parameters(BaseModel):
    """Parameters of `falling-body`."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    example: Literal["6.1-2", "6.1-3"] = Field(
        default="6.1-3", description="where the radar is: below, or aside"
    )
    initial_error: Literal["published", "gaussian"] = Field(
        default="published", description="the source's, in every run, or drawn as filters expect it"
    )
    interval: float = Field(default=0.01, gt=0.0, description="time between measurements, s")
    measurement_variance: float = Field(
        default=100.0, gt=0.0, description="variance of each measurement's noise, ft^2"
    )


def build(parameters: Parameters) -> System:
    """The system with the given parameters."""
    import numpy as np

    return System(
        drift=_drift,
        observe=_altitude if parameters.example == "6.1-2" else _range,
        measurement_cov=[[parameters.measurement_variance]],
        initial=Moments(mean=np.array(MEAN), cov=np.diag(VARIANCE)),
        sample=_published if parameters.initial_error == "published" else None,
        coordinates=(
            Coordinate("altitude", "ft"),
            Coordinate("velocity", "ft/s"),
            Coordinate("ballistic", "lb/ft^2"),
        ),
        diverged=_diverged,
        clip=(500.0, 500.0, 1500.0),
        interval=parameters.interval,
        step=0.01,
    )


def _drift(t: Any, x: Any) -> Any:
    import jax.numpy as jnp

    altitude, velocity, ballistic = x
    drag = DENSITY * jnp.exp(-altitude / HEIGHT) * velocity**2 / (2.0 * ballistic)
    return velocity, drag - GRAVITY, 0.0


def _altitude(t: Any, x: Any) -> Any:
    return x[:1]


def _range(t: Any, x: Any) -> Any:
    import jax.numpy as jnp

    return jnp.sqrt(ASIDE**2 + (x[:1] - ABOVE) ** 2)


def _published(key: Any) -> Any:
    """Every run starts at the source's true state."""
    import jax.numpy as jnp

    return jnp.array(PUBLISHED)


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 10_000.0
