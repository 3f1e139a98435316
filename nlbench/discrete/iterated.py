"""The iterated extended Kalman filter: the most probable state by Gauss-Newton, the measurement counted once.

The posterior of a Gaussian prior N(m, P) and y = h(x, v) has its mode where, with x = m + P u, r(x) = y - h(x, 0) and
D the Jacobian of h in v,
  (1) J(u) = u'P u + r' (D R D')^-1 r
is least. Iteration i linearises h at x_i = m + P u_i, with Jacobian H_i and S_i = H_i P H_i' + D_i R D_i':
  (2) u_new = H_i' S_i^-1 (r(x_i) + H_i P u_i)
  (3) u_(i+1) = u_i + a (u_new - u_i), with the first a of 1, 1/2, ..., 1/32, 0 that does not raise J
and after the last one P+ = P - P H' S^-1 H P with its H and S: each iteration starts again from the prior, so the
measurement is counted once, and on a linear problem any number of iterations gives the Kalman filter. One iteration is
the EKF's update. No inverse of P is needed. The step (3) makes the iterations converge where the plain ones (a = 1)
may go round and round. Predictions are the EKF's. State: mean and covariance. Cost: iterations x O(n^3).
Source: Bell and Cathey 1993, IEEE Trans. Automatic Control 38, 294-297 (Gauss-Newton); the choice of a is ours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Gaussian, Predicted, information, limited, predicted, symmetric
from nlbench.discrete.expansion import first
from nlbench.discrete.linearised import slope, step

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

FRACTIONS = (1.0, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32)


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """The filter of `options.iterations` iterations."""

    def update(seen: Observation, t: Any, prior: Gaussian, y: Any) -> tuple[Gaussian, UpdateInfo]:
        return _update(seen, options.iterations, t, prior, y)

    return gaussian.build(name, system, options, step, slope, update)


class Tangent(NamedTuple):
    """h linearised at a point: H (m, n), with no row where y was not taken, and the measurement as foretold there."""

    H: Any
    foretold: Predicted


def _update(
    seen: Observation, iterations: int, t: Any, prior: Gaussian, y: Any
) -> tuple[Gaussian, UpdateInfo]:
    P = prior.cov

    def tangent(u: Any) -> Tangent:
        h = first(seen.function, t, prior.mean + P @ u, len(seen.cov))
        H = jnp.where(jnp.isnan(y)[:, None], 0.0, h.x) if seen.missing else h.x
        S = H @ P @ H.T + h.w @ seen.cov @ h.w.T
        return Tangent(H, predicted(seen, y, seen.innovation(y, h.value), S, P @ H.T))

    def iterate(u: Any, at: Tangent) -> Any:
        H, S = at.H, at.foretold.S
        whole = H.T @ jnp.linalg.solve(S, limited(at.foretold, seen.limiter) + H @ P @ u)  # (2)
        noise = S - H @ P @ H.T

        def cost(u: Any) -> Any:
            value = seen.function(t, prior.mean + P @ u, jnp.zeros(len(seen.cov)))
            r = seen.innovation(y, value)
            r = jnp.where(jnp.isnan(y), 0.0, r) if seen.missing else r
            return u @ P @ u + r @ jnp.linalg.solve(noise, r)  # (1)

        tried = jnp.array([*FRACTIONS, 0.0])
        points = u + tried[:, None] * (whole - u)
        # A cost that is not a number, as without noise, leaves the whole step.
        raises = jax.vmap(cost)(points) > cost(u)
        return points[jnp.argmin(raises)]  # (3)

    u = jnp.zeros(len(prior.mean))
    start = last = tangent(u)
    for iteration in range(iterations):
        last = tangent(u) if iteration else start
        u = iterate(u, last)
    S, C = last.foretold.S, last.foretold.C
    cov = P - C @ jnp.linalg.solve(S, C.T)
    return Gaussian(prior.mean + P @ u, symmetric(cov)), information(start.foretold)
