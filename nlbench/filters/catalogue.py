"""The table of named filters: each is a propagation, an update and a safeguard. Loads no numerical library."""

from __future__ import annotations

from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat


class Integrator(BaseModel):
    """An integrator of the moment equations: a solver of diffrax by name, with tolerances (None: fixed steps)."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    solver: str = Field(default="rk4", description="rk4, or the name of a diffrax solver such as Tsit5")
    rtol: PositiveFloat | None = Field(default=None, description="relative tolerance of an adaptive solver")
    atol: PositiveFloat | None = Field(default=None, description="absolute tolerance of an adaptive solver")


class Options(BaseModel):
    """Options of a moment filter."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    equations: Literal["corrected", "printed"] = Field(
        default="corrected", description="the corrected equations, or those that the source printed"
    )
    limiter: PositiveFloat | None = Field(default=None, description="clip residuals at this many sigmas")
    limiter_scope: Literal["all", "nonlinear"] = Field(
        default="all", description="clip every use of the residual, or only those in the nonlinear terms"
    )
    guard: Literal["none", "sub1"] = Field(
        default="none", description="fall back to the sub1 update where the full one loses positiveness"
    )
    integrator: Integrator = Field(default=Integrator(), description="integrator of the moment equations")
    step: PositiveFloat | None = Field(
        default=None, description="integration step; default: the experiment's"
    )
    missing: bool = Field(default=True, description="whether measurements may be NaN, meaning not taken")


class GuardedOptions(Options):
    """Options of a filter whose safeguard is the guard."""

    guard: Literal["none", "sub1"] = "sub1"


class ExactOptions(BaseModel):
    """Options of the exact reference."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Row(NamedTuple):
    """One named filter. `order` is that of its moment equations; `update` names a function of `nlbench.updates`."""

    says: str
    source: str
    order: int
    update: str
    options: type[BaseModel] = Options


CULVER = "Culver 1969"
FILTERS = {
    "linearised-kalman": Row(
        "Kalman filter linearised at its own estimate", f"{CULVER}, 4.71-4.72", 1, "kalman"
    ),
    "ekf": Row("another name of linearised-kalman", f"{CULVER}, 4.71-4.72", 1, "kalman"),
    "second-order": Row("second-order moment equations, Kalman update", f"{CULVER}, 5.66", 2, "kalman"),
    "third-order": Row(
        "third-order moment equations, optimal Hermite update", f"{CULVER}, table 5.1", 3, "hermite3"
    ),
    "third-order-sub1": Row(
        "third order, Kalman mean and covariance at updates", f"{CULVER}, 5.67", 3, "sub1"
    ),
    "third-order-sub2": Row("third order, Kalman covariance at updates", f"{CULVER}, 5.68", 3, "sub2"),
    "third-order-guarded": Row(
        "third order that falls back to sub1 where positiveness is lost",
        f"{CULVER}, table 5.1 and 5.67",
        3,
        "hermite3",
        GuardedOptions,
    ),
    "third-order-4": Row(
        "third-order update, fourth-order moment equations, fourth cumulant set to zero at updates",
        f"{CULVER}, figure 7.24",
        4,
        "hermite3",
    ),
    "fourth-order": Row(
        "fourth-order moment equations, exact Hermite update", f"{CULVER}, 5.5 corrected", 4, "hermite4"
    ),
    "fourth-order-guarded": Row(
        "fourth order that falls back to sub1 where positiveness is lost",
        f"{CULVER}, 5.5 corrected",
        4,
        "hermite4",
        GuardedOptions,
    ),
    "exact": Row(
        "the exact posterior, where the system has one", "Bayes's rule on a grid", 0, "bayes", ExactOptions
    ),
}


def available() -> tuple[str, ...]:
    """Names that `nlbench.filters.build` takes."""
    return tuple(FILTERS)


def options(name: str) -> type[BaseModel]:
    """The pydantic model of the filter's options."""
    return FILTERS[name].options


def summary(name: str) -> str:
    """One line on what the filter is, with its source."""
    row = FILTERS[name]
    return f"{row.says} ({row.source})"
