"""A posterior as probabilities of fixed points: its start, Bayes's rule, its moments. What makes it move is given.

With probabilities w_p of points x_p in the cells of an even grid, each of volume v, and y = h(x, v), linear in v,
  (1) w_p = v N(x_p; m, P) at the start
  (2) w_p = c w_p N(y; h(x_p, 0), D(x_p) R D(x_p)'),  1/c = the predictive density of y
  (3) m = sum w_p x_p,  central moments = sum w_p (x_p - m)(x_p - m) ...
Even sums over Gaussians err by 2 exp(-2 pi^2 s^2), s the standard deviation in units of the spacing: 5e-9 for s = 1.
So no prior and no noise narrower than the spacing is taken. What the grid cannot hold must not pass for exact: where
too much probability has left it, or most of it is in one cell, the weights become not a number, which the engine
counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, log_determinant, squared_distance
from nlbench.discrete.catalogue import Options
from nlbench.discrete.correction import Gaussian, information, predicted
from nlbench.discrete.mixture import overall
from nlbench.discrete.problem import observation
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter
from nlbench.moments.closures import fourth_coefficient
from nlbench.moments.moments import Components, Moments, dense, to_full
from nlbench.references.dependence import depends
from nlbench.references.sums import total

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation
    from nlbench.discrete.time import Clock
    from nlbench.filters.filter import UpdateInfo
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

MOST_LOST = 1e-4  # at ten standard deviations it moves a mean by a thousandth of one
MOST_IN_ONE_CELL = 0.5  # of a Gaussian of s < .8


class Masses(NamedTuple):
    """Probabilities of the points, (p,)."""

    weights: Any


class Grid(NamedTuple):
    """The points (p, n) of an even grid, the first axis slowest, and their distances (n,) along the axes."""

    points: np.ndarray
    spacing: np.ndarray


def bind(
    system: System | DiscreteSystem, grid: Grid, clock: Clock, slope: Callable[[Any, Any], Any] | None = None
) -> Filter:
    """The filter. slope: (t, weights) -> their time derivatives, where time is continuous.

    Raises `ConfigError` where noise enters the measurement nonlinearly, and where the prior is narrower than the
    spacing.
    """
    seen = observation(system, Options())
    if not seen.linear:
        raise ConfigError(
            "exact: noise enters the measurement nonlinearly, so the density of y given x is not known"
        )
    refuse_narrow("the prior", system.initial.cov, grid)
    points = jnp.asarray(grid.points)

    def update(state: Masses, t: Any, y: Any, key: Any = None) -> tuple[Masses, UpdateInfo]:
        return _weighed(seen, points, state, t, jnp.asarray(y))

    def rates(state: Masses, t: Any, y: Any = None) -> Moments:
        moments = lambda weights: to_full(_moments(points, Masses(weights)))  # noqa: E731
        given = lambda: (slope(t, state.weights),)  # noqa: E731
        return jax.jvp(moments, (state.weights,), clock.rates("exact", given))[1]

    return Filter(
        name="exact",
        system=system,
        init=lambda moments, key=None: _start(points, grid.spacing, moments),
        predict=lambda state, t0, t1, key=None: clock.predict(state, t0, t1),
        update=update,
        moments=lambda state: to_full(_moments(points, state)),
        rates=rates,
        integrate=clock.integrate,
        components=lambda state: _moments(points, state),
    )


def kept(weights: Any, amiss: Any, most: float = MOST_LOST) -> Masses:
    """The weights, not numbers where more than `most` of the probability is `amiss`."""
    return Masses(jnp.where(amiss > most, jnp.nan, weights))


def refuse_narrow(what: str, cov: Any, grid: Grid) -> None:
    """Raises `ConfigError` where a Gaussian of covariance (..., n, n) is narrower than the spacing in any direction."""
    scaled = np.asarray(cov, float) / np.outer(grid.spacing, grid.spacing)
    narrowest = np.sqrt(max(np.linalg.eigvalsh(scaled).min(), 0.0))
    if narrowest < 1.0:
        raise ConfigError(
            f"exact: {what} has a standard deviation of {narrowest:.2g} spacings of the grid and needs 1: take more "
            "points; a singular covariance does not work"
        )


def log_normal(z: Any, S: Any, there: Any) -> Any:
    """log N(z; 0, S) of the entries of z (m,) that are there, S (m, m)."""
    m = len(z)
    residual = Tensor.symmetric(m, 1, lambda r: jnp.where(there[r[0]], z[r[0]], 0.0))
    cov = Tensor.symmetric(
        m, 2, lambda rs: jnp.where(there[rs[0]] & there[rs[1]], S[rs], 1.0 if rs[0] == rs[1] else 0.0)
    )
    level = squared_distance(cov, residual) + log_determinant(cov)
    return -0.5 * (level + jnp.sum(there) * math.log(2 * math.pi))


def _start(points: Any, spacing: Any, moments: Moments) -> Masses:
    """(1)."""
    mean, cov = jnp.asarray(moments.mean, float), jnp.asarray(moments.cov, float)
    there = np.ones(len(mean), bool)
    level = jax.vmap(lambda x: log_normal(x - mean, cov, there))(points)
    weights = jnp.exp(level) * np.prod(spacing)
    whole = jnp.sum(weights)
    return kept(weights / whole, jnp.abs(1.0 - whole))


def _weighed(seen: Observation, points: Any, prior: Masses, t: Any, y: Any) -> tuple[Masses, UpdateInfo]:
    """(2). What the measurement looks like from the points does not depend on y, so a block computes it once."""
    v, there = jnp.zeros(len(seen.cov)), ~jnp.isnan(y)

    def noise(x: Any) -> Any:
        D = jax.jacfwd(seen.function, 2)(t, x, v)
        return D @ seen.cov @ D.T

    h = jax.vmap(lambda x: seen.function(t, x, v))(points)
    everywhere = not depends(noise, points[0])
    R = noise(points[0]) if everywhere else jax.vmap(noise)(points)
    each = lambda h, R: log_normal(seen.innovation(y, h), R, there)  # noqa: E731
    level = jax.vmap(each, (0, None if everywhere else 0))(h, R)
    highest = jnp.max(jnp.where(prior.weights > 0, level, -jnp.inf))
    gained = prior.weights * jnp.exp(level - highest)
    whole = total(gained)
    weights = jnp.where(jnp.any(there), gained / whole, prior.weights)
    posterior = kept(weights, jnp.max(weights), MOST_IN_ONE_CELL)

    centre = seen.function(t, prior.weights @ points, v)
    d = jax.vmap(lambda h: seen.innovation(h, centre))(h)
    foretold = overall(prior.weights, Gaussian(d, jnp.broadcast_to(R, (len(h), *R.shape[-2:]))))
    z = seen.innovation(y, centre + foretold.mean)
    info = information(predicted(seen, y, z, foretold.cov, jnp.zeros((0, len(z)))))
    evidence = jnp.where(jnp.any(there), jnp.log(whole) + highest, 0.0)
    return posterior, info._replace(log_likelihood=evidence)


def _moments(points: Any, state: Masses) -> Components:
    """(3), the fourth as a Hermite coefficient."""
    w, n = state.weights, points.shape[1]
    mean = [total(w * points[:, i]) for i in range(n)]
    d = [points[:, i] - mean[i] for i in range(n)]

    def central(order: int) -> Tensor:
        return Tensor.symmetric(n, order, lambda index: total(w * math.prod(d[i] for i in index)))

    cov = central(2)
    first = Tensor.symmetric(n, 1, lambda i: mean[i[0]])
    return dense(Components(first, cov, central(3), fourth_coefficient(central(4), cov)))
