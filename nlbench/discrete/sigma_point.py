"""Gaussian filters whose expectations are sums over points: unscented, cubature, Gauss-Hermite.

With P = L L' and the points xi_i of a rule of `points`, e_i = L xi_i and x_i = m + e_i. Where noise enters linearly,
f(x, w) = f(x, 0) + G(x) w:
  (1) m- = E f(x, 0),  P- = cov(f(x, 0)) + E[G(x) Q G(x)']
  (2) z = y - E h(x, 0),  S = cov(h(x, 0)) + E[D(x) R D(x)'],  C = cov(x, h(x, 0))
and elsewhere the points are those of (x, w) or (x, v) together, with f(x, w) and h(x, v) in place of f(x, 0), h(x, 0).
The points of (2) are laid anew, on m- and P-. In continuous time (Sarkka 2007)
  (3) dm = E f,  dP = E[f e'] + E[e f'] + E[G V G'],
with points laid anew at each stage of the integration. Deviations of h are formed as the system forms residuals, from
h(m), so that angles may wrap. State: mean and covariance. Cost: points x (evaluation + n^2).
Sources: Julier and Uhlmann 1997 (`ukf`); Arasaratnam and Haykin 2009 (`ckf`); Ito and Xiong 2000, IEEE Trans.
Automatic Control 45, 910-927 (`ghkf`); Sarkka 2007, IEEE Trans. Automatic Control 52, 1631-1641 (continuous time).
Fails when P loses positiveness (NaN), and when the density is far from normal.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Gaussian, correct, predicted
from nlbench.discrete.points import Points, cubature, gauss_hermite, square_root, unscented
from nlbench.discrete.problem import Noisy, Observation, spectrum, stacked, variables

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

Rule = Callable[[int], Points]


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """`ukf`, `ckf` or `ghkf`."""
    rule: Rule = cubature
    if name == "ukf":
        rule = partial(unscented, alpha=options.alpha, beta=options.beta, kappa=options.kappa)
    if name == "ghkf":
        rule = partial(gauss_hermite, count=options.points)
    return gaussian.build(
        name, system, options, partial(_step, rule), partial(_slope, rule), partial(_update, rule), rule
    )


class Laid(NamedTuple):
    """Points laid on a Gaussian: e (p, n) from its mean, noise (p, s), and the rule with its weights."""

    e: Any
    noise: Any
    rule: Points


def lay(rule: Rule, prior: Gaussian, noise: Noisy | Observation) -> Laid:
    """The points of x, with w = 0 where noise enters linearly; else those of (x, w)."""
    n, s = len(prior.mean), len(noise.cov)
    points = rule(variables(noise, n))
    e = points.at[:, :n] @ square_root(prior.cov).T
    if noise.linear:
        return Laid(e, jnp.zeros((len(e), s)), points)
    return Laid(e, points.at[:, n:] @ square_root(noise.cov).T, points)


def noise_cov(noise: Noisy | Observation, t: Any, mean: Any, laid: Laid) -> Any:
    """E[G(x) Q G(x)'] where noise enters linearly; zero where the points hold it."""
    if not noise.linear:
        return 0.0

    def at(x: Any) -> Any:
        G = jax.jacfwd(noise.function, 2)(t, x, jnp.zeros(len(noise.cov)))
        return G @ noise.cov @ G.T

    return jnp.tensordot(laid.rule.mean, jax.vmap(at)(mean + laid.e), 1)


def covariance(weights: Any, a: Any, b: Any) -> Any:
    """sum c_i a_i b_i', of a (p, n) and b (p, m)."""
    return (weights[:, None] * a).T @ b


def _step(rule: Rule, motion: Noisy, k: Any, prior: Gaussian) -> Gaussian:
    """(1)."""
    laid = lay(rule, prior, motion)
    f = jax.vmap(lambda e, w: motion.function(k, prior.mean + e, w))(laid.e, laid.noise)
    mean = laid.rule.mean @ f
    d = f - mean
    cov = covariance(laid.rule.cov, d, d) + noise_cov(motion, k, prior.mean, laid)
    return Gaussian(mean, cov)


def _slope(rule: Rule, system: System, t: Any, prior: Gaussian) -> Gaussian:
    """(3)."""
    points = rule(len(prior.mean))
    e = points.at @ square_root(prior.cov).T
    f = jax.vmap(lambda e: stacked(system.drift_with_inputs(t, prior.mean + e)))(e)
    fe = covariance(points.cov, f, e)
    noise = jax.vmap(lambda e: spectrum(system, t, prior.mean + e))(e)
    return Gaussian(points.mean @ f, fe + fe.T + jnp.tensordot(points.mean, noise, 1))


def _update(rule: Rule, seen: Observation, t: Any, prior: Gaussian, y: Any) -> tuple[Gaussian, UpdateInfo]:
    """(2)."""
    laid = lay(rule, prior, seen)
    centre = seen.function(t, prior.mean, jnp.zeros(len(seen.cov)))
    h = jax.vmap(lambda e, v: seen.function(t, prior.mean + e, v))(laid.e, laid.noise)
    d = jax.vmap(lambda h: seen.innovation(h, centre))(h)
    shift = laid.rule.mean @ d
    d = d - shift
    S = covariance(laid.rule.cov, d, d) + noise_cov(seen, t, prior.mean, laid)
    z = seen.innovation(y, centre + shift)
    return correct(prior, predicted(seen, y, z, S, covariance(laid.rule.cov, laid.e, d)), seen.limiter)
