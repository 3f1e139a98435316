"""Gaussian filters whose expectations are sums over points: unscented, cubature, Gauss-Hermite.

With P = L L' and the points xi_i of a rule of `points`, e_i = L xi_i and x_i = m + e_i. Where noise enters linearly,
f(x, w) = f(x, 0) + G(x) w:
  (1) m- = E f(x, 0),  P- = cov(f(x, 0)) + E[G(x) Q G(x)']
  (2) z = y - E h(x, 0),  S = cov(h(x, 0)) + E[D(x) R D(x)'],  C = cov(x, h(x, 0))
and elsewhere the points are those of (x, w) or (x, v) together, with f(x, w) and h(x, v) in place of f(x, 0), h(x, 0).
The points of (2) are laid anew, on m- and P-. In continuous time (Sarkka 2007)
  (3) dm = E f,  dP = E[f e'] + E[e f'] + E[G V G'],
with points laid anew at each stage of the integration: for `propagation` F = E[f xi'] L^-1. Deviations of h are formed
as the system forms residuals, from h(m), so that angles may wrap. State: mean and root. Cost: points x (evaluation +
n^2). Sources: Julier and Uhlmann 1997 (`ukf`); Arasaratnam and Haykin 2009 (`ckf`); Ito and Xiong 2000, IEEE Trans.
Automatic Control 45, 910-927 (`ghkf`); Sarkka 2007, IEEE Trans. Automatic Control 52, 1631-1641 (continuous time).
Fails when the density is far from normal. P is a covariance unless a weight is negative, as of a `ukf` with small
alpha: what it takes off can be too much, and then all is NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Spread, conditioned, factor, joint
from nlbench.discrete.points import Points, cubature, gauss_hermite, unscented
from nlbench.discrete.problem import Noisy, Observation, spectrum, stacked, variables
from nlbench.discrete.propagation import Local
from nlbench.discrete.roots import quotient, square_root, triangular

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

Rule = Callable[[int], Points]


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """Bind `ukf`, `ckf` or `ghkf`."""
    rule: Rule = cubature
    if name == "ukf":
        rule = partial(unscented, alpha=options.alpha, beta=options.beta, kappa=options.kappa)
    if name == "ghkf":
        rule = partial(gauss_hermite, count=options.points)
    return gaussian.build(
        name, system, options, partial(_step, rule), partial(_local, rule), partial(_update, rule), rule
    )


class Laid(NamedTuple):
    """Points laid on a Gaussian: e (p, n) from its mean, noise (p, s), and the rule with its weights."""

    e: Any
    noise: Any
    rule: Points


def lay(rule: Rule, prior: Spread, noise: Noisy | Observation) -> Laid:
    """Lay the points of x, with w = 0 where noise enters linearly; else those of (x, w)."""
    n, s = len(prior.mean), len(noise.cov)
    points = rule(variables(noise, n))
    e = points.at[:, :n] @ prior.root.T
    if noise.linear:
        return Laid(e, jnp.zeros((len(e), s)), points)
    return Laid(e, points.at[:, n:] @ square_root(noise.cov).T, points)


def noise_root(noise: Noisy | Observation, t: Any, mean: Any, laid: Laid) -> Any:
    """The root of E[G Q G'], G the Jacobian in the noise; of nothing where the points hold the noise already."""
    if not noise.linear:
        return jnp.zeros((len(noise.function(t, mean, laid.noise[0])), 0))

    def at(x: Any) -> Any:
        G = jax.jacfwd(noise.function, 2)(t, x, jnp.zeros(len(noise.cov)))
        return G @ noise.cov @ G.T

    return square_root(jnp.tensordot(laid.rule.mean, jax.vmap(at)(mean + laid.e), 1))


def averaged(rule: Points, values: Any) -> Any:
    """sum w_i f_i of values (p, k), from the first of them, so that large weights of both signs lose no digits."""
    return values[0] + rule.mean @ (values - values[0])


def _step(rule: Rule, motion: Noisy, k: Any, prior: Spread) -> Spread:
    """(1)."""
    laid = lay(rule, prior, motion)
    f = jax.vmap(lambda e, w: motion.function(k, prior.mean + e, w))(laid.e, laid.noise)
    mean = averaged(laid.rule, f)
    columns, signs = _columns(laid.rule, f - mean)
    return Spread(mean, factor(columns, noise_root(motion, k, prior.mean, laid), signs))


def _columns(rule: Points, deviations: Any) -> tuple[Any, np.ndarray]:
    """Columns |c_i|^1/2 d_i of deviations (p, k), and the signs of the weights."""
    return (np.sqrt(np.abs(rule.cov))[:, None] * deviations).T, np.where(rule.cov < 0, -1.0, 1.0)


def _local(rule: Rule, system: System, t: Any, mean: Any, columns: Any) -> Local:
    """(3)."""
    points, L = rule(len(mean)), triangular(columns)
    e = points.at @ L.T
    f = jax.vmap(lambda e: stacked(system.drift_with_inputs(t, mean + e)))(e)
    F = quotient((points.cov[:, None] * (f - f[0])).T @ points.at, L)
    noise = None
    if system.diffusion is not None:
        each = jax.vmap(lambda e: spectrum(system, t, mean + e))(e)
        noise = square_root(jnp.tensordot(points.mean, each, 1))
    return Local(averaged(points, f), F, noise)


def _update(rule: Rule, seen: Observation, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
    """(2)."""
    laid = lay(rule, prior, seen)
    centre = seen.function(t, prior.mean, jnp.zeros(len(seen.cov)))
    h = jax.vmap(lambda e, v: seen.function(t, prior.mean + e, v))(laid.e, laid.noise)
    d = jax.vmap(lambda h: seen.innovation(h, centre))(h)
    shift = averaged(laid.rule, d)
    of_y, signs = _columns(laid.rule, d - shift)
    of_x, _ = _columns(laid.rule, laid.e)
    z = seen.innovation(y, centre + shift)
    noise = noise_root(seen, t, prior.mean, laid)
    return conditioned(prior, joint(seen, y, z, noise, of_y, of_x, signs), seen.limiter)
