"""The bootstrap particle filter with systematic resampling.

N particles x_i with weights w_i carry the density; they move as the system does, each with noise of its own. With
h(x, v) = h(x, 0) + D(x) v a measurement has, given x_i, the density N(y; h(x_i, 0), D R D'), and
  (1) log w_i += log N(y; h(x_i, 0), D(x_i) R D(x_i)'), normalised
  (2) N_eff = 1 / sum w_i^2
Where N_eff falls below the share `threshold` of N, the particles are drawn anew and weigh the same again: particle i
as often as points (u + j) / N, u uniform on (0, 1), j = 0 ... N - 1, fall into its stretch of the summed weights.
State: particles (N, n), weights and a key. Cost: N evaluations. Moments have errors of N_eff^-1/2.
Source: Gordon, Salmond and Smith 1993, IEE Proceedings F 140, 107-113; Kitagawa 1996 (systematic resampling).
Fails when hardly a particle is where the measurement says: without process noise, or with little measurement noise.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.checks import refuse_exact
from nlbench.discrete import particles
from nlbench.discrete.correction import Gaussian, information, log_density, predicted
from nlbench.discrete.mixture import overall
from nlbench.discrete.problem import observation
from nlbench.discrete.roots import square_root
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


class Particles(NamedTuple):
    """x: (N, n). log_weights: (N,), normalised. key: plain numbers, for the noise to come."""

    x: Any
    log_weights: Any
    key: Any


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """Bind the filter of `options.particles` particles.

    Raises `ConfigError` where y given x has no density that is known: where noise enters the measurement nonlinearly,
    or not at all.
    """
    seen = observation(system, options)
    if not seen.linear:
        raise ConfigError(
            f"{name}: noise enters the measurement nonlinearly, so the density of y given x is not known; "
            "ensemble takes such systems"
        )
    with jax.ensure_compile_time_eval():
        mean, nothing = jnp.asarray(system.initial.mean, float), jnp.zeros(len(seen.cov))
        D = jax.jacfwd(seen.function, 2)(0, mean, nothing)
        refuse_exact(name, D @ seen.cov @ D.T)

    def start(x: Any, key: Any) -> Particles:
        return Particles(x, jnp.full(len(x), -math.log(len(x))), key)

    def update(seen: Observation, prior: Particles, t: Any, y: Any) -> tuple[Particles, UpdateInfo]:
        weighed, info = _weighed(seen, prior, t, y)
        return _resampled(weighed, options.threshold), info

    return particles.bind(
        name,
        system,
        options,
        start,
        update,
        lambda state: _moments(jnp.exp(state.log_weights), state.x),
    )


def effective(state: Particles) -> Any:
    """(2), how many particles of equal weight would say as much."""
    return 1 / jnp.sum(jnp.exp(2 * state.log_weights))


def _moments(weights: Any, x: Any) -> Gaussian:
    """Weighted mean and covariance of points (N, n)."""
    mean = weights @ x
    d = x - mean
    cov = (weights[:, None] * d).T @ d
    return Gaussian(mean, (cov + cov.T) / 2)


def _weighed(seen: Observation, prior: Particles, t: Any, y: Any) -> tuple[Particles, UpdateInfo]:
    """(1)."""
    q = len(seen.cov)
    weights = jnp.exp(prior.log_weights)

    def at(x: Any) -> tuple[Any, Any]:
        D = jax.jacfwd(seen.function, 2)(t, x, jnp.zeros(q))
        return seen.function(t, x, jnp.zeros(q)), D @ seen.cov @ D.T

    h, R = jax.vmap(at)(prior.x)
    centre = seen.function(t, weights @ prior.x, jnp.zeros(q))
    d = jax.vmap(lambda h: seen.innovation(h, centre))(h)
    foretold_z = overall(weights, Gaussian(d, R))

    def gain(h: Any, R: Any) -> Any:
        z, S, _, taken, _ = predicted(seen, y, seen.innovation(y, h), R, jnp.zeros((0, len(h))))
        return log_density(z, square_root(S), taken)

    gained = prior.log_weights + jax.vmap(gain)(h, R)  # (1)
    total = jax.nn.logsumexp(gained)
    z = seen.innovation(y, centre + foretold_z.mean)
    foretold = predicted(seen, y, z, foretold_z.cov, jnp.zeros((0, len(centre))))
    info = information(foretold)._replace(log_likelihood=total)
    return prior._replace(log_weights=gained - total), info


def _resampled(state: Particles, threshold: float) -> Particles:
    """Systematic resampling where (2) asks for it."""
    count = len(state.x)
    key, used = particles.split(state.key)
    summed = jnp.cumsum(jnp.exp(state.log_weights))
    points = (jax.random.uniform(used) + jnp.arange(count)) / count * summed[-1]
    chosen = jnp.minimum(jnp.searchsorted(summed, points), count - 1)
    due = effective(state) < threshold * count
    return Particles(
        x=jnp.where(due, state.x[chosen], state.x),
        log_weights=jnp.where(due, -math.log(count), state.log_weights),
        key=key,
    )
