"""The table of named filters: each is a propagation, an update and a safeguard. Loads no numerical library."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from nlbench import plugins
from nlbench.continuous.catalogue import ROWS as CONTINUOUS
from nlbench.continuous.catalogue import SHARED as ALSO_CONTINUOUS
from nlbench.discrete.catalogue import ROWS as DISCRETE
from nlbench.discrete.catalogue import Options as SampledOptions
from nlbench.discrete.catalogue import Propagation
from nlbench.row import Row, StrictOptions
from nlbench.solvers import Solver, Tolerances


class Integrator(Tolerances):
    """An integrator of the moment equations: a solver of diffrax by name, with tolerances (None: fixed steps)."""

    solver: Solver = Field(default="rk4", description="rk4, or the name of a diffrax solver such as Tsit5")


class Options(StrictOptions):
    """Options of a moment filter."""

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


class LinearisedOptions(Options):
    """Options of the linearised filter."""

    propagation: Propagation = Field(
        default="moments",
        description="integrate the moment equations, or carry the covariance through the transition of each step, "
        "which keeps small variances right beside large ones",
    )

    @model_validator(mode="after")
    def _fit(self) -> LinearisedOptions:
        if self.propagation == "transition" and self.integrator != Integrator():
            raise ValueError(
                "propagation: transition makes steps of rk4: leave integrator out, or take moments"
            )
        return self


class CurvedOptions(Options):
    """Options of an update that looks beyond the linearised measurement: a limiter then clips every use."""

    limiter_scope: Literal["all"] = "all"


class TemperingOptions(CurvedOptions):
    """Options of the integration update."""

    steps: PositiveInt | None = Field(
        default=None,
        le=100_000,
        description="equal RK4 steps in pseudo-time; default: 5 or more, by the information that is let in",
    )
    measurement: Literal["linear", "quadratic"] = Field(
        default="linear", description="expand the measurement to first or to second order"
    )


class TwoStepOptions(CurvedOptions):
    """Options of the two-step updates."""

    steps: PositiveInt = Field(default=10, le=100_000, description="RK4 steps in pseudo-time")
    closure: Literal["quasi-moment", "cumulant"] | None = Field(
        default=None,
        description="of fifth and sixth moments; default: quasi-moment if corrected, cumulant if printed",
    )


class DirectOptions(CurvedOptions):
    """Options of direct numerical integration."""

    points: int = Field(
        default=51, ge=3, le=100_000, description="points per dimension, over 17 prior sigmas"
    )


class QuadratureOptions(CurvedOptions):
    """Options of Gauss-Hermite quadrature."""

    points: int = Field(default=9, ge=3, le=1000, description="nodes per dimension")


class GuardedOptions(Options):
    """Options of a filter whose safeguard is the guard."""

    guard: Literal["none", "sub1"] = "sub1"


CULVER = "Culver 1969"
MOMENT = {
    "linearised-kalman": Row(
        "Kalman filter linearised at its own estimate", f"{CULVER}, 4.71-4.72", 1, "kalman", LinearisedOptions
    ),
    "ekf": Row("another name of linearised-kalman", f"{CULVER}, 4.71-4.72", 1, "kalman", LinearisedOptions),
    "second-order": Row(
        "second-order moment equations, Kalman update", f"{CULVER}, 5.66", 2, "kalman", Options
    ),
    "third-order": Row(
        "third-order moment equations, optimal Hermite update", f"{CULVER}, table 5.1", 3, "hermite3", Options
    ),
    "third-order-sub1": Row(
        "third order, Kalman mean and covariance at updates", f"{CULVER}, 5.67", 3, "sub1", Options
    ),
    "third-order-sub2": Row(
        "third order, Kalman covariance at updates", f"{CULVER}, 5.68", 3, "sub2", Options
    ),
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
        Options,
    ),
    "fourth-order": Row(
        "fourth-order moment equations, exact Hermite update",
        f"{CULVER}, 5.5 corrected",
        4,
        "hermite4",
        Options,
    ),
    "fourth-order-guarded": Row(
        "fourth order that falls back to sub1 where positiveness is lost",
        f"{CULVER}, 5.5 corrected",
        4,
        "hermite4",
        GuardedOptions,
    ),
    "series-3": Row(
        "series expansion of the update, third order", f"{CULVER}, F.37-F.40", 3, "series", CurvedOptions
    ),
    "series-4": Row(
        "series expansion of the update, fourth order", f"{CULVER}, F.37-F.41", 4, "series", CurvedOptions
    ),
    "integration-update": Row(
        "third order, the update integrated in pseudo-time",
        f"{CULVER}, G.21",
        3,
        "tempering",
        TemperingOptions,
    ),
    "two-step-2": Row(
        "second order, Kalman update bent to a quadratic measurement",
        f"{CULVER}, 5.83-5.84",
        2,
        "two-step",
        TwoStepOptions,
    ),
    "two-step-3": Row(
        "third order, Hermite update bent to a quadratic measurement",
        f"{CULVER}, 5.83-5.85",
        3,
        "two-step",
        TwoStepOptions,
    ),
    "direct-2": Row(
        "Bayes's rule for a Gaussian prior, integrated over even steps",
        f"{CULVER}, 5.6",
        2,
        "direct",
        DirectOptions,
    ),
    "direct-3": Row(
        "Bayes's rule for a third-order prior, integrated over even steps",
        f"{CULVER}, 5.6",
        3,
        "direct",
        DirectOptions,
    ),
    "quadrature-2": Row(
        "Bayes's rule for a Gaussian prior, by Gauss-Hermite nodes at the mode",
        "Bayes's rule by quadrature",
        2,
        "quadrature",
        QuadratureOptions,
    ),
    "quadrature-3": Row(
        "Bayes's rule for a third-order prior, by Gauss-Hermite nodes at the mode",
        "Bayes's rule by quadrature",
        3,
        "quadrature",
        QuadratureOptions,
    ),
}
EXACT = Row(
    "the exact posterior, where the system has one",
    "Bayes's rule on a grid",
    0,
    "bayes",
    StrictOptions,
    "reference",
)
NO_FILTER = Row(
    "the initial mean and covariance throughout, whatever is measured",
    "a baseline",
    1,
    "none",
    SampledOptions,
    "baseline",
)
FILTERS = {**DISCRETE, **CONTINUOUS, **MOMENT, "no-filter": NO_FILTER, "exact": EXACT}

# Kinds of systems, (discrete, continuous) as in `row`, and which of them a family of filters takes.
KINDS = {
    (False, False): "continuous time",
    (True, False): "discrete time",
    (False, True): "continuous measurements",
}
TAKEN = {
    "moment": [(False, False)],
    "continuous": [(False, True)],
    "discrete": [(False, False), (True, False)],
    "baseline": list(KINDS),
    "reference": list(KINDS),
    "plugin": [(False, False), (True, False)],  # or fewer: its factory may refuse a system
}


def row(name: str, discrete: bool = False, continuous: bool = False) -> Row:
    """The row of that name; of several filters of one name, such as `ekf`, the one for the system's kind.

    discrete: whether its time is discrete. continuous: whether its measurements are continuous.
    """
    if continuous and name in ALSO_CONTINUOUS:
        return ALSO_CONTINUOUS[name]
    if discrete and name in DISCRETE:
        return DISCRETE[name]
    return FILTERS[name] if name in FILTERS else _plugged(name)


def takes(name: str) -> tuple[tuple[bool, bool], ...]:
    """The kinds of systems that filters of that name are for, (discrete, continuous) as in `row`."""
    return tuple(kind for kind in KINDS if kind in TAKEN[row(name, *kind).family])


def refusal(name: str, discrete: bool = False, continuous: bool = False) -> str | None:
    """Why no filter of that name is for systems of a kind; None where one is."""
    if (discrete, continuous) in takes(name):
        return None
    if discrete:
        return "integrates a drift in time, and the system's time is discrete"
    if continuous:
        return "takes measurements at discrete times, and the system's are continuous"
    return "takes continuous measurements, and the system's are at discrete times"


def available() -> tuple[str, ...]:
    """Names that `nlbench.filters.build` takes, those of plug-ins last."""
    return (*FILTERS, *plugins.names("filters"))


def options(name: str, discrete: bool = False, continuous: bool = False) -> type[BaseModel]:
    """The pydantic model of the options of the filter that `row` gives."""
    return row(name, discrete, continuous).options


def summary(name: str) -> str:
    """One line on what the filter is, with its source."""
    found = row(name)
    return f"{found.says} ({found.source})"


def _plugged(name: str) -> Row:
    """The row of a filter of a plug-in. Raises `ConfigError` for an installed one that is broken."""
    found = plugins.find("filters", name)
    if found is None:
        raise KeyError(name)
    plugin, entry = found
    return Row(entry.summary, plugin.file, 2, name, entry.parameters, "plugin")
