"""Filters of continuous measurements: one of the families' equations, stepped through measurements held over a step.

The state is the moments' unique components, with the nominal state where there is one. Without a measurement, and where
all of it is missing, the rates are the autonomous ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, log_determinant
from nlbench.continuous import stepping
from nlbench.continuous.families import State, equations
from nlbench.continuous.sampling import sampled
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.equations import fourth_moment_rate
from nlbench.moments.moments import Moments, to_components, to_full

if TYPE_CHECKING:
    from nlbench.continuous.catalogue import Options
    from nlbench.continuous.sensing import Sensed
    from nlbench.row import Row
    from nlbench.systems.system import System


def bind(name: str, row: Row, system: System, options: Options) -> Filter:
    """The filter of a catalogue row, bound to a system.

    Raises `ConfigError` where no step is known, samples do not fall on steps, or printed
    equations do not fit.
    """
    h = options.step or system.default_step
    if h is None:
        raise ConfigError(f"{name}: needs the length of its steps: give `step`, here or of the system")
    if system.sampling is not None:
        gaps = options.model_copy(update={"missing": True})
        return sampled(name, system, h, lambda system: bind(name, row, system, gaps))
    equation = equations(name, row, system, options)
    advance = stepping.build(options.integrator)

    def update(
        state: State, t: Any, y: Any, key: Any = None, sighting: Any = None
    ) -> tuple[State, UpdateInfo]:
        sensed = equation.sense(t, state, y)
        info = _information(sensed, equation.residual(sensed, state), h)
        return moved(state, t, h, lambda t, state: equation.sense(t, state, y)), info

    def moved(state: State, t: Any, h: Any, sense: Callable) -> State:
        """A step later, with what `sense` makes of the measurement held over it."""
        return advance(
            lambda t, state: _dense(equation.rates(t, state, sense(t, state))),
            lambda t, state: _dense(equation.ito_rates(t, state, sense(t, state))),
            t,
            h,
            state,
        )

    def integrate(state: State, t: Any, h: Any, count: Any) -> State:
        """Without measurements."""
        return jax.lax.fori_loop(
            0, count, lambda i, state: moved(state, t + i * h, h, lambda t, state: None), state
        )

    def rates(state: State, t: Any, y: Any = None) -> Moments:
        sensed = None if y is None else equation.sense(t, state, y)
        found = equation.moments(equation.rates(t, state, sensed))
        full = to_full(found._replace(fourth=None))
        if found.fourth is None:
            return full
        return full._replace(fourth=fourth_moment_rate(equation.moments(state), found).to_array())

    def refuse(*arguments: Any, **named: Any) -> Any:
        raise ConfigError(f"{name}: has no predict: measurements are continuous, and each update is a step")

    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: _dense(equation.start(to_components(moments, row.order))),
        predict=refuse,
        update=update,
        moments=lambda state: to_full(equation.moments(state)),
        rates=rates,
        integrate=integrate,
        components=equation.moments,
    )


def _dense(state: State) -> State:
    """Every component of a state an array, so that loops can carry it and a step can add to it."""
    return jax.tree.map(lambda tensor: tensor.dense(), state, is_leaf=lambda part: isinstance(part, Tensor))


def _information(sensed: Sensed, nu: Tensor, h: float) -> UpdateInfo:
    """What a step learned: nu, its covariance Gamma/h under white noise, and the density of it."""
    distance = einsum("r,r->", einsum("rs,s->r", sensed.W, nu), nu)[()]
    entries = sensed.taken * math.log(2 * math.pi / h)
    return UpdateInfo(
        innovation=nu.to_array(),
        innovation_cov=sensed.gamma.to_array() / h,
        log_likelihood=-0.5 * (h * distance + log_determinant(sensed.gamma) + entries),
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )
