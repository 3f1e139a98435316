"""Exact or nearly exact posteriors, as filters that run beside the others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(system: System | DiscreteSystem) -> Filter:
    """The exact reference of a system.

    Raises `ConfigError` where it has none, and where measurements are continuous: a reference takes them as samples.
    """
    from nlbench.references import (
        initial_grid,
        kalman_bank,
        linear_gaussian,
        parameter_bank,
        point_mass,
        remembered,
        zakai,
    )
    from nlbench.systems import exact
    from nlbench.systems.system import kind

    if system.exact is None:
        raise ConfigError("exact: this system has no exact reference")
    if kind(system).continuous:
        raise ConfigError(
            "exact: measurements are continuous, and the exact posterior takes samples of them, of the variance "
            "PSD/step, one at the start of each step; in an experiment say `reference: exact`"
        )
    if isinstance(system.exact, exact.LinearGaussian):
        return linear_gaussian.build(system)
    builders = {
        exact.InitialGrid: initial_grid.build,
        exact.InitialPosterior: remembered.build,
        exact.KalmanBank: kalman_bank.build,
        exact.ParameterBank: parameter_bank.build,
        exact.PointMass: point_mass.build,
        exact.ZakaiGrid: zakai.build,
    }
    return builders[type(system.exact)](system, system.exact)
