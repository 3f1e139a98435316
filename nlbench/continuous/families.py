"""The families of equations for continuous measurements, each as the same few functions of its own state."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, expand
from nlbench.continuous import kushner, kushner_printed, nominal, second_order, weighted
from nlbench.continuous.nominal import AboutNominal
from nlbench.continuous.second_order import FILTERS, MISPRINTED, SecondOrder
from nlbench.continuous.sensing import Sensed, curved_residual, sense
from nlbench.errors import ConfigError
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.continuous.catalogue import KushnerOptions, NominalOptions, Options, WeightedOptions
    from nlbench.row import Row
    from nlbench.systems.system import System

State = Any  # Components, or AboutNominal


class Equations(NamedTuple):
    """The equations of one filter.

    start: Components -> state. moments: state, or its rates, -> Components.
    sense: (t, state, y) -> Sensed. residual: (Sensed, state) -> (m,), y less what the filter expects of it.
    rates: (t, state, Sensed or None) -> rates of the state, by ordinary calculus. ito_rates: the same in Ito's sense.
    """

    start: Callable
    moments: Callable
    sense: Callable
    residual: Callable
    rates: Callable
    ito_rates: Callable


def equations(name: str, row: Row, system: System, options: Options) -> Equations:
    """The equations of a catalogue row. Raises `ConfigError` where the printed ones do not fit the system."""
    make = {"kushner": _kushner, "nominal": _nominal, "weighted": _weighted}.get(row.update, _second_order)
    return make(name, row, system, options)


def _kushner(name: str, row: Row, system: System, options: KushnerOptions) -> Equations:
    order, h = row.order, options.step or system.default_step
    printed = {"printed": kushner_printed.general, "printed-scalar": kushner_printed.scalar}.get(
        options.equations
    )
    if options.equations == "printed-scalar":
        _refuse_vectors(name, system, "printed-scalar")
        _refuse_curved_measurement(name, system)

    def rates(t: Any, state: Components, sensed: Sensed | None) -> Components:
        found = kushner.rates(system, order, t, state, sensed)
        return found if printed is None or sensed is None else printed(order, found, state, sensed)

    def ito_rates(t: Any, state: Components, sensed: Sensed | None) -> Components:
        found = rates(t, state, sensed)
        if found.fourth is None or sensed is None:
            return found
        if printed is None:
            return found._replace(fourth=found.fourth - kushner.ito_term(state, sensed))
        return found._replace(fourth=found.fourth - kushner_printed.euler_term(found, h))

    return _of_components(system, options, 2, _curved, rates, ito_rates)


def _second_order(name: str, row: Row, system: System, options: Options) -> Equations:
    parts: SecondOrder = FILTERS[row.update]
    if options.equations == "printed" and name in MISPRINTED:
        _refuse_vectors(name, system, "printed")
        parts = MISPRINTED[name]
    rates = partial(second_order.rates, system, parts)
    return _of_components(
        system, options, row.order, lambda sensed, state: parts.residual(sensed, state.cov), rates, rates
    )


def _weighted(name: str, row: Row, system: System, options: WeightedOptions) -> Equations:
    rates = partial(weighted.rates, system, options.k)
    return _of_components(
        system,
        options,
        2,
        lambda sensed, state: weighted.residual(sensed, state.cov, options.k),
        rates,
        rates,
    )


def _nominal(name: str, row: Row, system: System, options: NominalOptions) -> Equations:
    given, n = options.nominal, system.states
    if given is not None and np.shape(np.atleast_1d(given)) != (n,):
        raise ConfigError(f"{name}.nominal: got {np.size(given)} numbers, the system has {n} states")

    def start(moments: Components) -> AboutNominal:
        if given is None:
            return AboutNominal(moments, moments.mean)
        return AboutNominal(
            moments, Tensor.from_array(np.atleast_1d(np.asarray(given, float)), ((0,),)).dense()
        )

    rates = partial(nominal.rates, system)
    return Equations(
        start=start,
        moments=lambda state: state.moments,
        sense=lambda t, state, y: sense(system, t, list(state.nominal), y, options.missing, 1),
        residual=nominal.residual,
        rates=rates,
        ito_rates=rates,
    )


def _of_components(
    system: System,
    options: Options,
    order: int,
    residual: Callable,
    rates: Callable,
    ito_rates: Callable,
) -> Equations:
    """Equations whose state is the moments, expanded about the mean."""
    return Equations(
        start=lambda moments: moments,
        moments=lambda state: state,
        sense=lambda t, state, y: sense(system, t, list(state.mean), y, options.missing, order),
        residual=residual,
        rates=rates,
        ito_rates=ito_rates,
    )


def _curved(sensed: Sensed, state: Components) -> Tensor:
    return curved_residual(sensed, state.cov)


def _refuse_vectors(name: str, system: System, printed: str) -> None:
    if (system.states, system.measurements) != (1, 1):
        raise ConfigError(
            f"{name}: equations: {printed} are printed for one state and one measurement, "
            f"and the system has {system.states} and {system.measurements}"
        )


def _refuse_curved_measurement(name: str, system: System) -> None:
    point = [jnp.asarray(float(value)) for value in system.initial.mean]
    if expand(system.observe, jnp.asarray(0.0), point, 2).second.entries:
        raise ConfigError(
            f"{name}: equations: printed-scalar are printed for a linear measurement, and the system's is not"
        )
