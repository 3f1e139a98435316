"""Which integrators of ordinary differential equations options can name. Loads no numerical library."""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import Field, PositiveFloat, model_validator

from nlbench.row import StrictOptions

# Of diffrax, those that integrate a field by itself: with error estimates, at fixed steps only, within tolerances only.
Adaptive = Literal["Bosh3", "Dopri5", "Dopri8", "Heun", "Midpoint", "Ralston", "ReversibleHeun", "Tsit5"]
Fixed = Literal["Euler", "LeapfrogMidpoint"]
Implicit = Literal["ImplicitEuler", "Kvaerno3", "Kvaerno4", "Kvaerno5"]
Solver = Literal["rk4", Adaptive, Fixed, Implicit]


class Tolerances(StrictOptions):
    """A solver by name, and the tolerances that make an adaptive one choose its steps."""

    solver: str
    rtol: PositiveFloat | None = Field(default=None, description="relative tolerance of an adaptive solver")
    atol: PositiveFloat | None = Field(default=None, description="absolute tolerance of an adaptive solver")

    @model_validator(mode="after")
    def _fit(self) -> Tolerances:
        adaptive = self.rtol is not None or self.atol is not None
        if adaptive and self.solver in ("euler", "rk4", *get_args(Fixed)):
            raise ValueError(
                f"{self.solver} makes fixed steps: leave rtol and atol out, or take another solver"
            )
        if not adaptive and self.solver in get_args(Implicit):
            raise ValueError(
                f"{self.solver} solves equations in each step: give rtol or atol, to which it does"
            )
        return self
