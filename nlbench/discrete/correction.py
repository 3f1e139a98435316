"""The linear correction that every Gaussian filter ends its update with, entries that were not taken left out.

With the residual z = y - E y, its covariance S and the cross-covariance C = cov(x, y) of the predicted measurement
  (1) K = C S^-1,  m+ = m + K z,  P+ = P - K C'
An entry of y that is NaN is taken out by a zero residual, a zero column of C and a unit variance in S.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp

from nlbench.filters.filter import UpdateInfo

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation


class Gaussian(NamedTuple):
    """Mean (n,) and covariance (n, n) of a state."""

    mean: Any
    cov: Any


class Predicted(NamedTuple):
    """The measurement as foretold: residual z (m,), its covariance S (m, m), cross-covariance C (n, m), and how many
    entries of y were taken."""

    z: Any
    S: Any
    C: Any
    taken: Any


def predicted(seen: Observation, y: Any, z: Any, S: Any, C: Any) -> Predicted:
    """What is left of z, S and C where entries of y are NaN."""
    S = symmetric(S)
    if not seen.missing:
        return Predicted(z, S, C, len(z))
    there = ~jnp.isnan(y)
    return Predicted(
        z=jnp.where(there, z, 0.0),
        S=jnp.where(there[:, None] & there, S, jnp.eye(len(there))),
        C=jnp.where(there, C, 0.0),
        taken=jnp.sum(there),
    )


def correct(prior: Gaussian, measurement: Predicted, limiter: float | None) -> tuple[Gaussian, UpdateInfo]:
    """(1), the residual clipped at `limiter` of its standard deviations."""
    _, S, C, _ = measurement
    K = jnp.linalg.solve(S, C.T).T
    mean = prior.mean + K @ limited(measurement, limiter)
    return Gaussian(mean, symmetric(prior.cov - K @ C.T)), information(measurement)  # (1)


def limited(measurement: Predicted, limiter: float | None) -> Any:
    """The residual, clipped at `limiter` of its standard deviations."""
    if limiter is None:
        return measurement.z
    bound = limiter * jnp.sqrt(jnp.maximum(jnp.diagonal(measurement.S), 0.0))
    return jnp.clip(measurement.z, -bound, bound)


def information(measurement: Predicted) -> UpdateInfo:
    """Residual, its covariance and the logarithm of its normal density; nothing is known of its skewness."""
    z, S = measurement.z, measurement.S
    return UpdateInfo(
        innovation=z,
        innovation_cov=S,
        log_likelihood=log_density(z, S, measurement.taken),
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )


def log_density(z: Any, S: Any, taken: Any) -> Any:
    """log N(z; 0, S) of the entries taken; NaN where the determinant of S is negative."""
    sign, log_determinant = jnp.linalg.slogdet(S)
    level = z @ jnp.linalg.solve(S, z) + log_determinant + taken * math.log(2 * math.pi)
    return jnp.where(sign > 0, -0.5 * level, jnp.nan)


def symmetric(P: Any) -> Any:
    """(P + P') / 2."""
    return (P + P.T) / 2
