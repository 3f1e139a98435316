"""Schwartz's scalar systems with continuous measurements (Schwartz 1967, chapter 5, figures 1-12).

  D1  dx/dt = -x/(1 + x^2) + v      M11  y = arctan x + w      M12  y = x + w                 (78), printed
  D2  dx/dt = -x^3 + v              M21  y = x + x^3 + w       M22  y = x + w                 (79), printed
White noises v and w have spectral densities sigma_v^2 = 1 and sigma_w^2 = 10 (printed); 5 s in steps of .001 s by the
rectangular rule, under which a sample of w has the variance sigma_w^2/dt (printed). Filters start from 0 (printed) with
the variance that the truth is drawn with, 1 for D1 and 1/4 for D2 (printed). Any dynamics may go with any measurement;
the source pairs them as above.

It is in the benchmark because eight filters were compared on it, in single runs and means over ten, and because such
noise leaves them little to tell apart: at sigma_w^2 = 10 the data hold almost nothing about x, at .1 they do. What a
filter assumes may differ from what is true (figures 10-11). Who ignores the factor dt (section 5.3) takes the variance
sigma^2/dt of the numbers drawn for the spectral density: at dt = .001 an `assumed_measurement_psd` of 10,000 and an
`assumed_process_psd` of 1,000 (inferred). Samples (figure 12) come once a `period`, which the source does not give.
Diverged (chosen): an error above 20.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.moments.moments import Moments
from nlbench.systems.exact import ZakaiGrid
from nlbench.systems.system import Coordinate, Sampling, System

SUMMARY = "two scalar systems with continuous measurements (Schwartz 1967, chapter 5)"
MEASUREMENT = "continuous"

INITIAL_VARIANCE = {"D1": 1.0, "D2": 0.25}


class InitialError(BaseModel):
    """A fixed initial error, truth minus estimate, in standard deviations."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    sigma: float = Field(description="initial error in standard deviations")


class Samples(BaseModel):
    """What filters see of the measurement when it is sampled."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    mode: Literal["hold", "pulse"] = Field(
        description="hold: each sample until the next; pulse: over its step, nothing between"
    )
    period: float = Field(gt=0.0, description="time from sample to sample, s, a multiple of the step")


class Parameters(BaseModel):
    """Parameters of `schwartz`. Those that are `assumed` are what filters believe in; None: the true ones."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    dynamics: Literal["D1", "D2"] = Field(default="D1", description="D1: -x/(1 + x^2); D2: -x^3")
    measurement: Literal["M11", "M12", "M21", "M22"] = Field(
        default="M11", description="M11: arctan x; M12, M22: x; M21: x + x^3"
    )
    process_psd: float = Field(default=1.0, ge=0.0, description="spectral density of the process noise")
    measurement_psd: float = Field(default=10.0, gt=0.0, description="spectral density of the measurement's")
    initial_variance: float | None = Field(
        default=None, gt=0.0, description="variance of the initial state; default 1 for D1, .25 for D2"
    )
    assumed_process_psd: float | None = Field(
        default=None, ge=0.0, description="process_psd that filters use"
    )
    assumed_measurement_psd: float | None = Field(
        default=None, gt=0.0, description="measurement_psd that filters use"
    )
    assumed_initial_variance: float | None = Field(
        default=None, gt=0.0, description="variance that filters start from"
    )
    sampling: Samples | None = Field(
        default=None, description="filters see samples of the measurement instead of all of it"
    )
    initial_error: InitialError | None = Field(
        default=None, description="a fixed initial error instead of draws"
    )


def build(parameters: Parameters) -> System:
    """The system with the given parameters, as filters see it; `truth` where that is another."""
    variance = parameters.initial_variance or INITIAL_VARIANCE[parameters.dynamics]
    sample = None
    if parameters.initial_error is not None:
        sample = _fixed(parameters.initial_error.sigma * math.sqrt(variance))
    true = (parameters.process_psd, parameters.measurement_psd, variance)
    given = (
        parameters.assumed_process_psd,
        parameters.assumed_measurement_psd,
        parameters.assumed_initial_variance,
    )
    assumed = tuple(own if other is None else other for own, other in zip(true, given, strict=True))
    if assumed == true:
        return _system(parameters, *true, sample=sample)
    return _system(parameters, *assumed, truth=_system(parameters, *true, sample=sample))


def _system(
    parameters: Parameters, process_psd: float, measurement_psd: float, variance: float, **more: Any
) -> System:
    noisy, samples = process_psd > 0.0, parameters.sampling
    return System(
        drift=_restoring if parameters.dynamics == "D1" else _cubic,
        observe=_OBSERVED[parameters.measurement],
        measurement_cov=[[measurement_psd]],
        measurement="continuous",
        initial=Moments(mean=[0.0], cov=[[variance]]),
        diffusion=_unit if noisy else None,
        diffusion_cov=[[process_psd]] if noisy else None,
        coordinates=(Coordinate("x"),),
        diverged=_diverged,
        clip=(5.0,),
        step=0.001,
        sampling=Sampling(samples.period, samples.mode == "hold") if samples else None,
        exact=_grid(parameters.dynamics, process_psd, measurement_psd, variance) if noisy else None,
        **more,
    )


def _grid(dynamics: str, process_psd: float, measurement_psd: float, variance: float) -> ZakaiGrid:
    """As wide as the state gets in 5 s; six cells in the standard deviation of a posterior of x + w, and so many that
    noise crosses one faster than the drift, by four to one. Halving the spacing then moves no estimate by .1 % of the
    RMS error."""
    deviation = (process_psd * measurement_psd) ** 0.25
    if dynamics == "D1":
        reach = 6.5 * math.sqrt(variance + 5.0 * process_psd)
        cells = max(12.0 * reach / deviation, 8.0 * reach / process_psd)
    else:  # where the stationary density exp(-x^4/(2 q)) is e^-128 of its highest, or the initial one ends
        reach = max(6.5 * math.sqrt(variance), 4.0 * process_psd**0.25)
        cells = 12.0 * reach / deviation
    return ZakaiGrid(-reach, reach, max(200, math.ceil(cells)))


def _restoring(t: Any, x: Any) -> Any:
    return -x / (1.0 + x**2)


def _cubic(t: Any, x: Any) -> Any:
    return -(x**3)


def _arctangent(t: Any, x: Any) -> Any:
    import jax.numpy as jnp

    # XLA's atan, and atan2(x, 1) that it turns into it, is wrong in 512-bit vectors (jaxlib 0.10.2 on CPUs).
    return jnp.arctan2(2.0 * x, 2.0)


def _identity(t: Any, x: Any) -> Any:
    return x


def _with_cube(t: Any, x: Any) -> Any:
    return x + x**3


_OBSERVED: dict[str, Callable[..., Any]] = {
    "M11": _arctangent,
    "M12": _identity,
    "M21": _with_cube,
    "M22": _identity,
}


def _unit(t: Any, x: Any) -> Any:
    import numpy as np

    return np.eye(1)


def _diverged(error: Any) -> Any:
    return abs(error[0]) > 20.0


def _fixed(start: float) -> Callable[[Any], Any]:
    """Every run starts at `start`."""

    def sample(key: Any) -> Any:
        import jax.numpy as jnp

        return jnp.full(1, start)

    return sample
