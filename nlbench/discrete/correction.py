"""The linear correction that every Gaussian filter ends its update with, entries that were not taken left out.

With the residual z = y - E y, its covariance S and the cross-covariance C = cov(x, y) of the predicted measurement
  (1) m+ = m + C S^-1 z,  P+ = P - C S^-1 C'
Filters that carry a root have z and the triangular factor T of the joint covariance of y and x, `roots` (2):
  (2) u = S^-1/2 z,  m+ = m + T_xy u,  L+ = T_xx
the others z, S and C. Either way the entries of y are taken in turn, each without what those before it have told, so
that several accurate sensors of the same thing lose no digits. An entry that was predicted with certainty tells
nothing. An entry of y that is NaN is taken out by a zero residual, no covariance with anything, and a unit variance.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench.discrete.roots import ldl, solved, square_root, triangular
from nlbench.filters.filter import UpdateInfo

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation

AGREES = 1e-8  # as a share of a measurement, by how much one that was certain may be off by rounding


class Gaussian(NamedTuple):
    """Mean (n,) and covariance (n, n) of a state."""

    mean: Any
    cov: Any


class Spread(NamedTuple):
    """Mean (n,) and lower triangular root (n, n) of the covariance of a state."""

    mean: Any
    root: Any

    @property
    def cov(self) -> Any:
        """The covariance (n, n)."""
        return self.root @ self.root.T


class Predicted(NamedTuple):
    """The measurement as predicted: residual z (m,), its covariance S (m, m), cross-covariance C (n, m); how many
    entries of y were taken; by how much an entry (m,) that was certain may be off."""

    z: Any
    S: Any
    C: Any
    taken: Any
    slack: Any


class Joint(NamedTuple):
    """Residual z (m,) and the triangular factor (m + n, m + n) of the covariance of measurement and state; the rest as
    of `Predicted`."""

    z: Any
    factor: Any
    taken: Any
    slack: Any


def predicted(seen: Observation, y: Any, z: Any, S: Any, C: Any) -> Predicted:
    """Return what is left of z, S and C where entries of y are NaN."""
    S, slack = symmetric(S), AGREES * (jnp.abs(y) + jnp.abs(z))
    if not seen.missing:
        return Predicted(z, S, C, len(z), slack)
    there = ~jnp.isnan(y)
    return Predicted(
        z=jnp.where(there, z, 0.0),
        S=jnp.where(there[:, None] & there, S, jnp.eye(len(there))),
        C=jnp.where(there, C, 0.0),
        taken=jnp.sum(there),
        slack=slack,
    )


def joint(
    seen: Observation, y: Any, z: Any, noise: Any, of_y: Any, of_x: Any, signs: np.ndarray | None = None
) -> Joint:
    """Return the factor of columns: `noise` (m, q) of y alone, and `of_y` (m, p) beside `of_x` (n, p) of the state.

    signs: (p,), of what each column adds to the covariance; None means that all add.
    """
    m, n = len(of_y), len(of_x)
    slack = AGREES * (jnp.abs(y) + jnp.abs(z))
    taken: Any = m
    if seen.missing:
        there = ~jnp.isnan(y)
        z, taken = jnp.where(there, z, 0.0), jnp.sum(there)
        of_y = jnp.where(there[:, None], of_y, 0.0)
        noise = jnp.concatenate([jnp.where(there[:, None], noise, 0.0), jnp.diag(1.0 - there)], 1)
    alone = jnp.concatenate([noise, jnp.zeros((n, noise.shape[1]))])
    return Joint(z, factor(jnp.concatenate([of_y, of_x]), alone, signs), taken, slack)


def factor(columns: Any, others: Any, signs: np.ndarray | None = None) -> Any:
    """Return the triangular factor of the sum of outer products of columns (r, p), with signs (p,), and others (r, q).

    NaN where columns that count negatively leave no covariance.
    """
    if signs is None or (signs > 0).all():
        return triangular(jnp.concatenate([columns, others], 1))
    return square_root(symmetric((columns * signs) @ columns.T + others @ others.T))


def conditioned(prior: Spread, measured: Joint, limiter: float | None) -> tuple[Spread, UpdateInfo]:
    """(2), the residual clipped at `limiter` of its standard deviations."""
    m = len(measured.z)
    T = measured.factor
    S_root = T[:m, :m]
    u = solved(S_root, clipped(measured.z, jnp.sum(S_root**2, 1), limiter))
    info = _information(measured.z, S_root @ S_root.T, S_root, measured.taken, measured.slack)
    return Spread(prior.mean + T[m:, :m] @ u, T[m:, m:]), info  # (2)


def correct(prior: Gaussian, measurement: Predicted, limiter: float | None) -> tuple[Gaussian, UpdateInfo]:
    """(1), the residual clipped at `limiter` of its standard deviations."""
    weighted_z, weighted_C, C = gains(measurement, limited(measurement, limiter))
    cov = symmetric(prior.cov - C.T @ weighted_C)
    return Gaussian(prior.mean + C.T @ weighted_z, cov), information(measurement)  # (1)


def gains(measurement: Predicted, z: Any) -> tuple[Any, Any, Any]:
    """Return S^-1/2 z and S^-1/2 C' weighted with the inverse variances, and S^-1/2 C', for residuals z (m,) or (m, k)
    and S = S^1/2 D S'^1/2 with a unit diagonal of S^1/2."""
    U, d = ldl(measurement.S)
    weights = jnp.where(d == 0, 0.0, 1 / jnp.where(d == 0, 1.0, d))
    z, C = solved(U, z), solved(U, measurement.C.T)
    return (weights * z.T).T, weights[:, None] * C, C


def limited(measurement: Predicted, limiter: float | None) -> Any:
    """Return the residual, clipped at `limiter` of its standard deviations."""
    return clipped(measurement.z, jnp.diagonal(measurement.S), limiter)


def clipped(z: Any, variance: Any, limiter: float | None) -> Any:
    """Return z (m,) within `limiter` standard deviations, those of a negative variance being zero."""
    if limiter is None:
        return z
    bound = limiter * jnp.sqrt(jnp.maximum(variance, 0.0))
    return jnp.clip(z, -bound, bound)


def information(measurement: Predicted) -> UpdateInfo:
    """Return residual, its covariance and the logarithm of its density; nothing is known of its skewness."""
    z, S, _, taken, slack = measurement
    return _information(z, S, square_root(S), taken, slack)


def _information(z: Any, S: Any, S_root: Any, taken: Any, slack: Any) -> UpdateInfo:
    return UpdateInfo(
        innovation=z,
        innovation_cov=S,
        log_likelihood=log_density(z, S_root, taken, slack),
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )


def log_density(z: Any, S_root: Any, taken: Any, slack: Any = 0.0) -> Any:
    """Return log N(z; 0, S) of the entries taken, by the root of S; NaN where S is no covariance.

    An entry that is certain, given those before it, has no density: it counts as probable, log 1 = 0, where it is what
    was predicted, to within `slack` (m,), and as impossible, -inf, elsewhere.
    """
    u, deviations = solved(S_root, z), jnp.diagonal(S_root)
    certain = deviations == 0
    off = jnp.any(certain & (jnp.abs(z - S_root @ u) > slack))
    level = jnp.sum(u**2) + 2 * jnp.sum(jnp.log(jnp.where(certain, 1.0, deviations)))
    level = level + (taken - jnp.sum(certain)) * math.log(2 * math.pi)
    return jnp.where(off, -jnp.inf, -0.5 * level)


def symmetric(P: Any) -> Any:
    """Return (P + P') / 2."""
    return (P + P.T) / 2
