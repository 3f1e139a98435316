"""The iterated extended Kalman filter: the most probable state by Gauss-Newton, the measurement counted once.

The posterior of a Gaussian prior N(m, L L') and y = h(x, v) has its mode where, with x = m + L u, r(x) = y - h(x, 0)
and D the Jacobian of h in v,
  (1) J(u) = u'u + r' (D R D')^-1 r
is least. Iteration i linearises h at x_i = m + L u_i, with A_i = H_i L of its Jacobian and S_i = A_i A_i' + D_i R D_i':
  (2) u_new = A_i' S_i^-1 (r(x_i) + A_i u_i)
  (3) u_(i+1) = u_i + a (u_new - u_i), with the first a of 1, 1/2, ..., 1/32, 0 that does not raise J
and after the last one P+ = L (I - A' S^-1 A) L' with its A and S: each iteration starts again from the prior, so the
measurement is counted once, and on a linear problem any number of iterations gives the Kalman filter. One iteration is
the EKF's update. No inverse of P is needed. The step (3) makes the iterations converge where the plain ones (a = 1)
may go round and round. Predictions are the EKF's. State: mean and root. Cost: iterations x O(n^3).
Source: Bell and Cathey 1993, IEEE Trans. Automatic Control 38, 294-297 (Gauss-Newton); the choice of a is ours.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Joint, Spread, clipped, conditioned, joint
from nlbench.discrete.expansion import first
from nlbench.discrete.linearised import local, step
from nlbench.discrete.roots import solved, square_root, triangular

if TYPE_CHECKING:
    from nlbench.discrete.problem import Observation
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

FRACTIONS = (1.0, 1 / 2, 1 / 4, 1 / 8, 1 / 16, 1 / 32)


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """The filter of `options.iterations` iterations."""

    def update(seen: Observation, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
        return _update(seen, options.iterations, t, prior, y)

    return gaussian.build(name, system, options, step, local, update)


class Tangent(NamedTuple):
    """h linearised at a point: A (m, n) and the root of D R D' (m, q), without rows where y was not taken, and the
    measurement as predicted there, with u in place of x."""

    A: Any
    noise: Any
    measured: Joint


def _update(seen: Observation, iterations: int, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
    n, B = len(prior.mean), square_root(seen.cov)

    def known(rows: Any) -> Any:
        return jnp.where(jnp.isnan(y)[:, None], 0.0, rows) if seen.missing else rows

    def tangent(u: Any) -> Tangent:
        h = first(seen.function, t, prior.mean + prior.root @ u, len(seen.cov))
        A, noise = known(h.x @ prior.root), known(h.w @ B)
        return Tangent(A, noise, joint(seen, y, seen.innovation(y, h.value), noise, A, jnp.eye(n)))

    def iterate(u: Any, at: Tangent) -> Any:
        m, T = len(at.A), at.measured.factor
        S_root = T[:m, :m]
        z = clipped(at.measured.z, jnp.sum(S_root**2, 1), seen.limiter)
        whole = T[m:, :m] @ solved(S_root, z + at.A @ u)  # (2)
        noise_root = triangular(at.noise)
        exact = jnp.any((jnp.diagonal(noise_root) == 0) & ~jnp.isnan(y))

        def cost(u: Any) -> Any:
            value = seen.function(t, prior.mean + prior.root @ u, jnp.zeros(len(seen.cov)))
            r = known(seen.innovation(y, value)[:, None])[:, 0]
            return jnp.where(exact, jnp.nan, u @ u + jnp.sum(solved(noise_root, r) ** 2))  # (1)

        tried = jnp.array([*FRACTIONS, 0.0])
        points = u + tried[:, None] * (whole - u)
        # A cost that is not a number, as without noise, leaves the whole step.
        raises = jax.vmap(cost)(points) > cost(u)
        return points[jnp.argmin(raises)]  # (3)

    u = jnp.zeros(n)
    start = last = tangent(u)
    for iteration in range(iterations):
        last = tangent(u) if iteration else start
        u = iterate(u, last)
    _, info = conditioned(Spread(u, jnp.eye(n)), start.measured, None)
    m = len(last.A)
    return Spread(prior.mean + prior.root @ u, prior.root @ last.measured.factor[m:, m:]), info
