"""The Kalman filter, for linear systems only, and the extended Kalman filter: the equations of `linearised`.

State: mean and covariance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.discrete import gaussian, linearised
from nlbench.discrete.problem import bends
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """`kalman` or `ekf`. Raises `ConfigError` if the first is asked for a system that is not linear."""
    bent = bends(system, options) if name == "kalman" else None
    if bent:
        raise ConfigError(
            f"kalman: {bent} is not linear, or cannot be told to be; ekf takes nonlinear systems"
        )
    return gaussian.build(name, system, options, linearised.step, linearised.local, linearised.update)
