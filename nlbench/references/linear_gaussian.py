"""The exact posterior of a linear system with Gaussian noise and prior: the Kalman filter's.

In continuous time it is exact but for the transition of each step, which is that of RK4.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.discrete import gaussian, linearised
from nlbench.discrete.catalogue import PropagatedOptions
from nlbench.discrete.problem import bends
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(system: System | DiscreteSystem) -> Filter:
    """The Kalman filter. Raises `ConfigError` where the system is not linear."""
    options = PropagatedOptions()
    bent = bends(system, options)
    if bent:
        raise ConfigError(f"exact: {bent} is not linear, or cannot be told to be")
    return gaussian.build("exact", system, options, linearised.step, linearised.local, linearised.update)
