"""The filters of continuous measurements as rows of the table of named filters. Loads no numerical library."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat

from nlbench.row import Row, StrictOptions
from nlbench.solvers import Solver, Tolerances


class Integrator(Tolerances):
    """How a step is made under a measurement held over it."""

    solver: Literal["euler", Solver] = Field(
        default="euler",
        description="euler, which converges to the filter in Ito's sense; rk4, or the name of a diffrax solver, "
        "converges to the Stratonovich reading of the same equations, which is another filter",
    )


class Options(StrictOptions):
    """Options of a filter of continuous measurements."""

    equations: Literal["corrected", "printed"] = Field(
        default="corrected", description="the corrected equations, or those that the source printed"
    )
    integrator: Integrator = Field(default=Integrator(), description="how a step is made")
    step: PositiveFloat | None = Field(default=None, description="length of a step; default: the system's")
    missing: bool = Field(default=True, description="whether measurements may be NaN, meaning not taken")


class KushnerOptions(Options):
    """Options of Culver's filters, which the source printed twice."""

    equations: Literal["corrected", "printed", "printed-scalar"] = Field(
        default="corrected",
        description="the corrected equations, the general ones as printed, or the printed ones of chapter 7",
    )


class NominalOptions(Options):
    """Options of the filter linear about a nominal motion."""

    nominal: float | list[float] | None = Field(
        default=None, description="where the nominal motion starts; default: the initial mean"
    )


class WeightedOptions(Options):
    """Options of the filter that weighs errors with exp(-k |x - xhat|^2)."""

    equations: Literal["corrected"] = Field(
        default="corrected",
        description="the printed (66) has P where P^-1 belongs, which is a misprint and no filter",
    )
    k: NonNegativeFloat = Field(default=0.0, description="the weight's k; 0 weighs all errors alike")


CULVER, SCHWARTZ, HENRIKSEN = "Culver 1969", "Schwartz 1967", "Henriksen 1980"


def _row(says: str, source: str, equations: str, options: type[Options] = Options, order: int = 2) -> Row:
    return Row(says, source, order, equations, options, "continuous")


ROWS = {
    "kushner-2": _row(
        "continuous measurements, second order, Gaussian density",
        f"{CULVER}, 4.69-4.70",
        "kushner",
        KushnerOptions,
    ),
    "kushner-3": _row(
        "continuous measurements, third order", f"{CULVER}, 4.64-4.67", "kushner", KushnerOptions, 3
    ),
    "kushner-4": _row(
        "continuous measurements, fourth order", f"{CULVER}, 4.64-4.68", "kushner", KushnerOptions, 4
    ),
    "schwartz-1": _row("linear about a nominal motion", f"{SCHWARTZ}, 80", "nominal", NominalOptions),
    "schwartz-2": _row("quasi-moment minimal variance", f"{SCHWARTZ}, 81", "gaussian"),
    "schwartz-3": _row("truncated minimal variance", f"{SCHWARTZ}, 82", "truncated"),
    "schwartz-4": _row("modified minimal variance", f"{SCHWARTZ}, 83", "modified"),
    "schwartz-5": _row("maximum-principle least squares", f"{SCHWARTZ}, 84", "maximum-principle"),
    "schwartz-6": _row("dynamic-programming least squares", f"{SCHWARTZ}, 85", "linearised", order=1),
    "schwartz-7": _row("discrete-measurement minimal variance", f"{SCHWARTZ}, 86", "discrete-truncated"),
    "schwartz-8": _row(
        "modified discrete-measurement minimal variance", f"{SCHWARTZ}, 87", "discrete-gaussian"
    ),
    "schwartz-k": _row("errors weighted by exp(-k |e|^2)", f"{SCHWARTZ}, 65-72", "weighted", WeightedOptions),
}
# Names of another family, and the filters that they are where measurements are continuous.
SHARED = {
    "linearised-kalman": _row(
        "Kalman-Bucy filter linearised at its own estimate", f"{CULVER}, 4.71-4.72", "linearised", order=1
    ),
    "ekf": _row("another name of linearised-kalman", f"{CULVER}, 4.71-4.72", "linearised", order=1),
    "truncated": _row("truncated second order, corrected", f"{HENRIKSEN}, 35-37", "modified"),
    "truncated-jazwinski": _row("truncated second order, erroneous", f"{SCHWARTZ}, 56", "truncated"),
}
