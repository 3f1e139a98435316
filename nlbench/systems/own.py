"""A system of the user's own, given to `nlbench.run` as a `System`: here is only what its results record of it."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from nlbench.errors import ConfigError
from nlbench.systems.system import System

SUMMARY = "a System of your own, given to nlbench.run from Python"


class Parameters(BaseModel):
    """What an experiment with an own system records of it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    interval: float | None = Field(default=None, gt=0.0, description="time between measurements")
    program: str | None = Field(default=None, description="what was compiled from it; filled in by the run")


def build(parameters: Parameters) -> System:
    """Not from parameters. Raises `ConfigError`, saying how."""
    raise ConfigError(
        'own: this system exists in Python only: nlbench.run({..., "system": nlbench.System(...)})'
    )
