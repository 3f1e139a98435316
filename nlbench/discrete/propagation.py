"""Mean and covariance of a Gaussian filter from one time to another, in continuous time.

Such a filter is a local approximation of the drift and the noise, f(x) ~ f + F (x - m) and
columns g with g g' the spectrum. Its moments obey
  (1) m' = f,  P' = F P + P F' + g g'
and integrated as such, a Runge-Kutta stage of P is no covariance where a variance is small beside others, as after an
accurate measurement. So over a step h the columns are carried instead, L of the start and g_j of the noise at Gauss's
nodes s_j with weights b_j on (0, h),
  (2) L' = F L,  X_j' = F X_j from X_j(s_j) = g_j,  P(h) = L L' + h sum b_j X_j X_j'
which is positive semidefinite whatever F is, and on linear systems Phi P Phi' + Q with Phi of the same Runge-Kutta
steps. What (2) looks up within the step, mean and L, follows from its stages, and F is the parabola through the nodes:
the whole is of fourth order in h, like the steps. Where f, F and g depend on P, the noise since the start of the step
enters P as s g g', which is of second order.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.discrete.correction import Gaussian, Spread
from nlbench.discrete.roots import absolute_root, nonnegative_root, triangular
from nlbench.moments.integrate import fixed_rk4

NODES = (1 + np.polynomial.legendre.leggauss(3)[0]) / 2  # of (0, 1)
WEIGHTS = np.polynomial.legendre.leggauss(3)[1] / 2


class Local(NamedTuple):
    """f (n,), F (n, n) and the noise's columns g (n, s), None without noise: what (1) is made of at a time."""

    f: Any
    F: Any
    g: Any


# (t, mean (n,), columns (n, p) whose outer products sum to P) -> Local
Approximation = Callable[[Any, Any, Any], Local]


class Carried(NamedTuple):
    """Mean (n,) and columns (n, p) after a step, and the columns (n, q) of the noise in it."""

    mean: Any
    columns: Any
    noise: Any


def moment_rates(local: Approximation, t: Any, at: Gaussian, root: Any) -> Gaussian:
    """(1). root: (n, n), of the covariance, for what the approximation looks up."""
    f, F, g = local(t, at.mean, root)
    FP = F @ at.cov
    rate = FP + FP.T
    return Gaussian(f, rate if g is None else rate + g @ g.T)


def carried(local: Approximation, t: Any, h: Any, mean: Any, columns: Any) -> Carried:
    """(2), for L = columns (n, p); the unit matrix gives Phi, where the approximation does not depend on P."""
    local = jax.jit(local)  # traced once
    first = local(t, mean, columns)

    def at(c: Any, y: tuple[Any, Any]) -> Local:
        m, L = y
        noise = [] if first.g is None else [jnp.sqrt(c * h) * first.g]
        return local(t + c * h, m, jnp.concatenate([L, *noise], 1))

    def slope(c: float, y: tuple[Any, Any]) -> tuple[Any, Any]:
        f, F, _ = first if c == 0 else at(c, y)
        return f, F @ y[1]

    start = (mean, columns)
    stages = _stages(slope, h, start)
    mean, columns = _between(1.0, h, start, stages)
    if first.g is None:
        return Carried(mean, columns, jnp.zeros((len(mean), 0)))
    nodes = jax.vmap(lambda c: at(c, _between(c, h, start, stages)))(jnp.asarray(NODES))
    noise = [np.sqrt(WEIGHTS[j]) * _to_the_end(nodes.F, h, j, nodes.g[j]) for j in range(len(NODES))]
    return Carried(mean, columns, jnp.sqrt(h) * jnp.concatenate(noise, 1))


def _stages(slope: Callable[[float, Any], Any], h: Any, y: Any) -> list[Any]:
    """The four slopes of a step of the classical Runge-Kutta method; slope: (share of the step, y) -> dy/dt."""
    stages: list[Any] = []
    for c in (0.0, 0.5, 0.5, 1.0):
        ahead = y if not stages else jax.tree.map(lambda y, k, c=c: y + c * h * k, y, stages[-1])
        stages.append(slope(c, ahead))
    return stages


def _between(c: Any, h: Any, y: Any, stages: list[Any]) -> Any:
    """y at a share c of the step, to third order within it (Hairer, Norsett and Wanner 1993, II.6)."""
    inner = c**2 - 2 * c**3 / 3
    weights = c - 3 * c**2 / 2 + 2 * c**3 / 3, inner, inner, 2 * c**3 / 3 - c**2 / 2
    return jax.tree.map(
        lambda y, *k: y + h * sum(w * each for w, each in zip(weights, k, strict=True)), y, *stages
    )


def _to_the_end(F: Any, h: Any, j: int, X: Any) -> Any:
    """X' = F X from node j to the end of the step, F (3, n, n) known at the nodes, by one Runge-Kutta step."""
    start, length = NODES[j], 1 - NODES[j]
    slope = lambda c, X: jnp.tensordot(_parabola(start + c * length), F, 1) @ X  # noqa: E731
    return _between(1.0, length * h, X, _stages(slope, length * h, X))


def _parabola(c: float) -> np.ndarray:
    """Weights of the values at the nodes in their parabola's value at c."""
    others = [np.delete(NODES, j) for j in range(len(NODES))]
    return np.array([np.prod((c - o) / (x - o)) for x, o in zip(NODES, others, strict=True)])


def propagator(local: Approximation, propagation: str) -> Callable[[Spread, Any, Any, Any], Spread]:
    """Return (state, t, h, count) -> the state `count` steps of h later: by (2), "transition", or by (1), "moments".

    Moments that a stage leaves without positiveness are looked up in what they are with all directions counted
    positively, which on linear systems changes nothing; of those at the end the negative directions are left out.
    """
    return partial(_by_transition if propagation == "transition" else _by_moments, local)


def _by_transition(local: Approximation, state: Spread, t: Any, h: Any, count: Any) -> Spread:
    def step(i: Any, state: Spread) -> Spread:
        mean, columns, noise = carried(local, t + i * h, h, *state)
        return Spread(mean, triangular(jnp.concatenate([columns, noise], 1)))

    if isinstance(count, int) and count == 1:
        return step(0, state)
    return jax.lax.fori_loop(0, count, step, state)


def _by_moments(local: Approximation, state: Spread, t: Any, h: Any, count: Any) -> Spread:
    def field(t: Any, at: Gaussian) -> Gaussian:
        return moment_rates(local, t, at, absolute_root(at.cov))

    mean, cov = fixed_rk4().integrate(field, t, h, count, Gaussian(state.mean, state.cov))
    return Spread(mean, nonnegative_root(cov))
