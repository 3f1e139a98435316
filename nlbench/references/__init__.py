"""Exact or nearly exact posteriors, as filters that run beside the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.system import System


def build(system: System) -> Filter:
    """The exact reference of a system. Raises `ConfigError` where it has none."""
    from nlbench.references import initial_grid, kalman_bank, remembered
    from nlbench.systems.system import InitialPosterior, KalmanBank

    if system.exact is None:
        raise ConfigError("exact: this system has no exact reference")
    if isinstance(system.exact, KalmanBank):
        return kalman_bank.build(system, system.exact)
    if isinstance(system.exact, InitialPosterior):
        return remembered.build(system, system.exact)
    return initial_grid.build(system, system.exact)
