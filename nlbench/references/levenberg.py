"""Levenberg's and Marquardt's damped Gauss-Newton method, for a fixed number of steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp


class Fit(NamedTuple):
    """A point (n,), half the sum of squares there, its gradient (n,) and Gauss-Newton matrix J'J (n, n)."""

    point: Any
    level: Any
    gradient: Any
    information: Any


def least_squares(residuals: Callable[[Any], Any], start: Any, steps: int) -> Fit:
    """Minimises |residuals(x)|^2 / 2 over x (n,), residuals (p,), from `start`; J must have full rank.

      (1) (J'J + l diag J'J) d = -J' residuals
    A step d that does not lower the level is taken back and l raised; l is 0 at first, so that where Gauss-Newton does
    well, it is Gauss-Newton.
    """

    def both(x: Any) -> tuple[Any, Any]:
        r = residuals(x)
        return r, r

    def step(_: Any, carry: tuple[Fit, Any, Any]) -> tuple[Fit, Any, Any]:
        best, damping, x = carry
        J, r = jax.jacfwd(both, has_aux=True)(x)
        fit = Fit(x, 0.5 * jnp.sum(r * r), r @ J, J.T @ J)
        lower = fit.level <= best.level
        best = jax.tree.map(lambda new, old: jnp.where(lower, new, old), fit, best)
        damping = jnp.where(lower, damping / 10, jnp.maximum(10 * damping, 1e-2))
        damped = best.information + damping * jnp.diag(jnp.diag(best.information))
        return best, damping, best.point - solve(damped, best.gradient)  # (1)

    n = len(start)
    nowhere = Fit(start, jnp.inf, jnp.zeros(n), jnp.eye(n))
    return jax.lax.fori_loop(0, steps + 1, step, (nowhere, jnp.zeros(()), start))[0]


def solve(matrix: Any, vector: Any) -> Any:
    """matrix^-1 vector, the matrix (n, n) symmetric and positive definite."""
    return jax.scipy.linalg.cho_solve((jnp.linalg.cholesky(matrix), True), vector)
