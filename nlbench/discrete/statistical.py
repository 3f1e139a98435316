"""Statistical linearisation: f and h replaced by the straight lines that fit them best under the Gaussian prior.

With P = L L', x = m + L xi, and for f(x, w), w = B omega, xi and omega standard normal, the line of least mean square
error is E f + E[f xi'] xi + E[f omega'] omega, and (Gelb 1974, 6.2)
  (1) m- = E f,   P- = E[f xi'] E[f xi']' + E[f omega'] E[f omega']'
  (2) z = y - E h,  S = E[h xi'] E[h xi']' + E[h nu'] E[h nu']',  cov(x, y) = L E[h xi']',   v = T nu
What the line leaves of f and h adds nothing to the covariances; that is where `ghkf` differs. Where noise enters
linearly, E[f omega'] = E[G(x)] B without points for w. In continuous time, for `propagation`,
  (3) dm = E f,  dP = F P + P F' + E[G] V E[G]',  F = E[f xi'] L^-1
Expectations are Gauss-Hermite sums. State: mean and root. Cost: points^n x (evaluation + n^2).
Fails when what the line leaves is not small.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Spread, conditioned, factor, joint
from nlbench.discrete.points import gauss_hermite
from nlbench.discrete.problem import Noisy, Observation, density_root, stacked, variables
from nlbench.discrete.propagation import Local
from nlbench.discrete.roots import quotient, square_root, triangular

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """The filter with `options.points` nodes per dimension."""
    count = options.points
    return gaussian.build(
        name,
        system,
        options,
        partial(_step, count),
        partial(_local, count),
        partial(_update, count),
        partial(gauss_hermite, count=count),
    )


def _line(
    count: int, noise: Noisy | Observation, t: Any, prior: Spread, values: Callable
) -> tuple[Any, Any, Any]:
    """E f, E[f xi'] and E[f omega'] of f = values(x, w), where `noise` says how w enters."""
    n, s = len(prior.mean), len(noise.cov)
    rule = gauss_hermite(variables(noise, n), count)
    xi, omega = rule.at[:, :n], rule.at[:, n:]
    x = prior.mean + xi @ prior.root.T
    B = square_root(noise.cov)
    if noise.linear:
        w = jnp.zeros((len(x), s))
        G = jax.vmap(lambda x: jax.jacfwd(noise.function, 2)(t, x, jnp.zeros(s)))(x)
        through_noise = jnp.tensordot(rule.mean, G, 1) @ B
        f = jax.vmap(values)(x, w)
    else:
        f = jax.vmap(values)(x, omega @ B.T)
        through_noise = (rule.mean[:, None] * f).T @ omega
    return rule.mean @ f, (rule.mean[:, None] * f).T @ xi, through_noise


def _step(count: int, motion: Noisy, k: Any, prior: Spread) -> Spread:
    """(1)."""
    f, A, L = _line(count, motion, k, prior, lambda x, w: motion.function(k, x, w))
    return Spread(f, factor(A, L))


def _local(count: int, system: System, t: Any, mean: Any, columns: Any) -> Local:
    """(3)."""
    rule, root = gauss_hermite(len(mean), count), triangular(columns)
    x = mean + rule.at @ root.T
    f = jax.vmap(lambda x: stacked(system.drift_with_inputs(t, x)))(x)
    F = quotient((rule.mean[:, None] * (f - f[0])).T @ rule.at, root)
    noise = None
    if system.diffusion is not None:
        diffusion = system.diffusion
        G = jnp.tensordot(rule.mean, jax.vmap(lambda x: jnp.asarray(diffusion(t, x)))(x), 1)
        noise = G @ density_root(system, G.shape[1])
    return Local(rule.mean @ f, F, noise)


def _update(count: int, seen: Observation, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
    """(2), deviations of h formed from h(m) as the system forms residuals."""
    centre = seen.function(t, prior.mean, jnp.zeros(len(seen.cov)))

    def deviation(x: Any, v: Any) -> Any:
        return seen.innovation(seen.function(t, x, v), centre)

    d, A, D = _line(count, seen, t, prior, deviation)
    z = seen.innovation(y, centre + d)
    return conditioned(prior, joint(seen, y, z, D, A, prior.root), seen.limiter)
