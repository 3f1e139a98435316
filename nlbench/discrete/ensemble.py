"""The ensemble Kalman filter with perturbed measurements.

N states x_i carry the density. At a measurement each foretells h_i = h(x_i, v_i) with noise v_i of its own, and
  (1) x_i+ = x_i + C S^-1 (y - h_i)
with C = cov(x, h(x, 0)) and S = cov(h(x, 0)) + E[D(x) R D(x)'] over the ensemble where noise enters linearly, as
h(x, 0) + D(x) v, and elsewhere C = cov(x, h_i), S = cov(h_i). State: the ensemble (N, n) and a key. Cost: N evaluations
and N n (n + m). Sources: Evensen 1994, J. Geophysical Research 99, 10143-10162; Burgers, van Leeuwen and Evensen
1998, Monthly Weather Review 126, 1719-1724 (perturbed measurements). Moments are sample moments: errors fall as
N^-1/2. Fails when N is not well above n: the ensemble then loses its spread.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.discrete import particles
from nlbench.discrete.correction import Gaussian, gains, information, predicted, symmetric
from nlbench.discrete.roots import square_root

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


class Ensemble(NamedTuple):
    """x: (N, n). key: plain numbers, for the noise to come."""

    x: Any
    key: Any


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """An ensemble of `options.particles` states."""
    return particles.bind(name, system, options, Ensemble, _updated, lambda state: _sample_moments(state.x))


def _sample_moments(x: Any) -> Gaussian:
    """Mean and unbiased covariance of a sample (N, n)."""
    mean = jnp.mean(x, 0)
    d = x - mean
    return Gaussian(mean, symmetric(d.T @ d / (len(x) - 1)))


def _updated(seen: Observation, prior: Ensemble, t: Any, y: Any) -> tuple[Ensemble, UpdateInfo]:
    """(1)."""
    x = prior.x
    key, used = particles.split(prior.key)
    v = jax.random.normal(used, (len(x), len(seen.cov))) @ square_root(seen.cov).T
    h = jax.vmap(lambda x, v: seen.function(t, x, v))
    perturbed = h(x, v)
    plain = h(x, jnp.zeros_like(v)) if seen.linear else perturbed
    centre = seen.function(t, jnp.mean(x, 0), jnp.zeros(len(seen.cov)))
    d = jax.vmap(lambda h: seen.innovation(h, centre))(plain)
    shift = jnp.mean(d, 0)
    S, C = _covariances(x, d - shift)
    if seen.linear:
        D = jax.vmap(lambda x: jax.jacfwd(seen.function, 2)(t, x, jnp.zeros(len(seen.cov))))(x)
        S = S + jnp.mean(D @ seen.cov @ D.mT, 0)
    foretold = predicted(seen, y, seen.innovation(y, centre + shift), S, C)
    residuals = jax.vmap(lambda h: seen.innovation(y, h))(perturbed)
    if seen.missing:
        residuals = jnp.where(jnp.isnan(y), 0.0, residuals)
    weighted, _, C = gains(foretold, residuals.T)
    moved = x + weighted.T @ C  # (1)
    return Ensemble(moved, key), information(foretold)


def _covariances(x: Any, d: Any) -> tuple[Any, Any]:
    """Sample covariances of d (N, m), mean zero, with itself and of x (N, n) with it."""
    e = x - jnp.mean(x, 0)
    return d.T @ d / (len(x) - 1), e.T @ d / (len(x) - 1)
