"""The exact posterior of a scalar system without process noise, on a grid of initial conditions.

The state at t is a known map of x(0), so Bayes's rule reweights the grid:
  (1) log w_p += log N(y; h(x_p(t)), R)
  (2) m = sum w_p x_p,  central moments = sum w_p (x_p - m)^k
Escaped points (infinite) carry no weight. Cost: p = 320 exponentials and divisions each time moments are formed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.moments import Components, Moments, dense, to_full
from nlbench.references.sums import total as sum_over_nodes

if TYPE_CHECKING:
    from nlbench.systems.exact import InitialGrid
    from nlbench.systems.system import System


class State(NamedTuple):
    """Time, and the logarithm of the weights of the grid's points (p,), up to a constant."""

    t: Any
    log_weights: Any


def build(system: System, grid: InitialGrid) -> Filter:
    """The grid posterior as a filter. `init` takes the prior from the grid, whatever moments it is given."""
    start = jnp.log(jnp.asarray(grid.weights))
    starts = jnp.asarray(grid.points)

    def init(moments: Moments, key: Any = None) -> State:
        return State(jnp.zeros(()), start)

    def integrate(state: State, t: Any, h: Any, count: Any) -> State:
        return State(jnp.asarray(t + count * h, start.dtype), state.log_weights)

    def update(state: State, t: Any, y: Any, key: Any = None) -> tuple[State, UpdateInfo]:
        points = grid.flow(t, starts)
        R = jnp.asarray(system.measurement_cov, start.dtype)[0, 0]
        h = jax.vmap(lambda x: jnp.asarray(system.observe(t, x[None])).reshape(()))(points)
        residual = jnp.asarray(y).reshape(()) - h
        there = jnp.isfinite(points)
        gained = jnp.where(there, -0.5 * jnp.square(jnp.where(there, residual, 0.0)) / R, -jnp.inf)
        gained = jnp.where(jnp.isnan(jnp.asarray(y).reshape(())), 0.0, gained)
        posterior = State(jnp.asarray(t, start.dtype), state.log_weights + gained)
        return posterior, _info(state, posterior, h, y, R)

    return Filter(
        name="exact",
        system=system,
        init=init,
        predict=lambda state, t0, t1, key=None: integrate(state, t0, t1 - t0, 1),
        update=update,
        moments=lambda state: to_full(_moments(grid, starts, state)),
        rates=lambda state, t, y=None: _rates(grid, starts, state._replace(t=jnp.asarray(t, start.dtype))),
        integrate=integrate,
        components=lambda state: _moments(grid, starts, state),
    )


def _weighed(state: State, points: Any) -> tuple[Any, Any, Any]:
    """Unnormalised weights, their sum, and the points with escaped ones put to zero."""
    there = jnp.isfinite(points)
    level = jnp.where(there, state.log_weights, -jnp.inf)
    weights = jnp.exp(level - jnp.max(level))
    return weights, sum_over_nodes(weights), jnp.where(there, points, 0.0)


def _moments(grid: InitialGrid, starts: Any, state: State) -> Components:
    weights, total, x = _weighed(state, grid.flow(state.t, starts))
    mean = sum_over_nodes(weights * x) / total  # (2)
    e = x - mean
    variance, third, fourth = (sum_over_nodes(weights * e**k) / total for k in (2, 3, 4))
    central = [variance, third, fourth - 3 * variance**2]
    return dense(
        Components(*(Tensor.symmetric(1, k + 1, lambda _, v=v: v) for k, v in enumerate([mean, *central])))
    )


def _rates(grid: InitialGrid, starts: Any, state: State) -> Moments:
    """Derivatives of the moments with the weights held, as they are between measurements."""
    moments = lambda t: to_full(_moments(grid, starts, state._replace(t=t)))  # noqa: E731
    return jax.jvp(moments, (state.t,), (jnp.ones_like(state.t),))[1]


def _info(prior: State, posterior: State, h: Any, y: Any, R: Any) -> UpdateInfo:
    weights, total, predicted = _weighed(State(prior.t, prior.log_weights), h)
    mean = sum_over_nodes(weights * predicted) / total
    variance = sum_over_nodes(weights * jnp.square(predicted - mean)) / total + R
    missing = jnp.isnan(jnp.asarray(y).reshape(()))
    gained = jax.nn.logsumexp(posterior.log_weights) - jax.nn.logsumexp(prior.log_weights)
    evidence = gained - 0.5 * jnp.log(2 * math.pi * R)
    innovation = jnp.where(missing, 0.0, jnp.asarray(y).reshape(()) - mean)
    return UpdateInfo(
        innovation=innovation[None],
        innovation_cov=variance[None, None],
        log_likelihood=jnp.where(missing, 0.0, evidence),
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )
