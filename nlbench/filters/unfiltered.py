"""No filter: the estimate and its covariance stay what they were at the start, whatever is measured.

The line to beat: data that hold next to nothing cannot be told from filters that use them badly without it (Schwartz's
systems at his noise, say). It takes every kind of system: in continuous or discrete time, measured at times, at angles
or continuously. What it says of a measurement is what its moments foretell, linearised at the mean:
  (1) z = y - h(t, m, 0),  S = H P H' + D R D',  R = Gamma/step where measurements are continuous
State: mean and covariance. Cost: none, but for (1). Fails where the state moves away from where it began.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from nlbench.discrete.correction import information, predicted
from nlbench.discrete.expansion import first
from nlbench.discrete.problem import observation
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo, central_angle
from nlbench.moments.moments import Components, Moments, to_components, to_full
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.discrete.catalogue import Options
    from nlbench.row import Row


def build(name: str, row: Row, system: System | DiscreteSystem, options: Options) -> Filter:
    """The filter that does nothing, bound to a system.

    Raises `ConfigError` where measurements are continuous and no step is known, over which one is held.
    """
    seen_as = _sampled(name, system, options.step)
    sightings = system.sightings if isinstance(system, System) else None

    def update(
        state: Components, t: Any, y: Any, key: Any = None, sighting: Any = None
    ) -> tuple[Components, UpdateInfo]:
        sought = seen_as if sighting is None else seen_as.sighted(sighting)
        return state, _foretold(sought, options, t, to_full(state), jnp.asarray(y))

    def rates(state: Components, t: Any, y: Any = None) -> Moments:
        mean, cov, *_ = to_full(state)
        return Moments(jnp.zeros_like(mean), jnp.zeros_like(cov))

    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: to_components(moments, row.order),
        predict=lambda state, t0, t1, key=None: state,
        update=update,
        moments=to_full,
        rates=rates,
        integrate=lambda state, t, h, count: state,
        components=lambda state: state,
        angle=None if sightings is None else lambda state: central_angle(system, state.mean),
    )


def _sampled(name: str, system: Any, step: float | None) -> Any:
    """The system with continuous measurements as samples, each held over a step."""
    if isinstance(system, DiscreteSystem) or system.measurement == "discrete":
        return system
    h = step or system.default_step
    if h is None:
        raise ConfigError(f"{name}: needs the length of its steps: give `step`, here or of the system")
    return replace(system, measurement="discrete", measurement_cov=np.asarray(system.measurement_cov) / h)


def _foretold(system: Any, options: Options, t: Any, moments: Moments, y: Any) -> UpdateInfo:
    """(1), entries of y left out that are NaN."""
    seen = observation(system, options)
    h = first(seen.function, t, moments.mean, len(seen.cov))
    C = moments.cov @ h.x.T
    S = h.x @ C + h.w @ seen.cov @ h.w.T
    return information(predicted(seen, y, seen.innovation(y, h.value), S, C))
