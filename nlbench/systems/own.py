"""A system of the user's own, given to `nlbench.run` from Python: here is only what its results record of it."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from nlbench.errors import ConfigError
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import System, kind

SUMMARY = "a System or DiscreteSystem of your own, given to nlbench.run from Python"


class Parameters(BaseModel):
    """What an experiment with an own system records of it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    interval: float | None = Field(default=None, gt=0.0, description="time between measurements")
    time: Literal["continuous", "discrete"] = Field(default="continuous", description="its time")
    measurement: Literal["discrete", "continuous"] = Field(
        default="discrete", description="whether measurements are made at times or all the time"
    )
    program: str | None = Field(default=None, description="what was compiled from it; filled in by the run")


def recorded(system: System | DiscreteSystem) -> dict[str, Any]:
    """The parameters that say of a system what an experiment must know beforehand; the interval is that of the data."""
    discrete, continuous = kind(system)
    return {
        "interval": (system.truth or system).interval,
        "time": "discrete" if discrete else "continuous",
        "measurement": "continuous" if continuous else "discrete",
    }


def build(parameters: Parameters) -> System | DiscreteSystem:
    """Not from parameters. Raises `ConfigError`, saying how."""
    raise ConfigError(
        'own: this system exists in Python only: nlbench.run({..., "system": nlbench.System(...)})'
    )
