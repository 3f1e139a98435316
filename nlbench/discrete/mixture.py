"""Sums of Gaussians: laid out from one, joined where they are alike, renewed, and their moments.

(1) sum w_i N(m_i, P_i) has mean m = sum w_i m_i and covariance sum w_i (P_i + d_i d_i'),  d_i = m_i - m
(2) joining i and j by (1) raises the Kullback-Leibler discrimination by at most
    ((w_i + w_j) log|P_ij| - w_i log|P_i| - w_j log|P_j|) / 2          (Runnalls 2007, (21))
    and without bound where i and j are certain of different things
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.discrete.correction import Gaussian, symmetric
from nlbench.discrete.points import gauss_hermite
from nlbench.discrete.roots import ldl, square_root

PAIRS = 1024  # whose costs are computed at once: each needs some nine matrices


class Mixture(NamedTuple):
    """log_weights (p,), normalised, -inf for a place that is free; each: mean (p, n) and cov (p, n, n)."""

    log_weights: Any
    each: Gaussian


def laid_out(prior: Gaussian, count: int, spread: float) -> Mixture:
    """`count` Gaussians per dimension, with the moments of one up to order 2 count - 1.

    Their means are Gauss-Hermite nodes of a Gaussian with the share `spread` of the prior's covariance, and each has
    the rest of it: the sum of two independent Gaussians, the first of them replaced by its nodes.
    """
    if count == 1:
        return Mixture(jnp.zeros(1), jax.tree.map(lambda part: part[None], prior))
    rule = gauss_hermite(len(prior.mean), count)
    means = prior.mean + np.sqrt(spread) * rule.at @ square_root(prior.cov).T
    covs = jnp.broadcast_to((1 - spread) * prior.cov, (len(means), *prior.cov.shape))
    return Mixture(jnp.log(jnp.asarray(rule.mean)), Gaussian(means, covs))


def renewed(mixture: Mixture, count: int, spread: float, share: float) -> Mixture:
    """Laid out anew from mean and covariance, where one Gaussian carries more than `share` of the weight."""
    fresh = laid_out(overall(jnp.exp(mixture.log_weights), mixture.each), count, spread)
    due = (jnp.max(mixture.log_weights) > jnp.log(share)) & jnp.all(jnp.isfinite(fresh.each.mean))
    return jax.tree.map(lambda new, old: jnp.where(due, new, old), fresh, mixture)


def overall(weights: Any, each: Gaussian) -> Gaussian:
    """(1), for weights (p,) that sum to one."""
    mean = weights @ each.mean
    d = each.mean - mean
    cov = jnp.tensordot(weights, each.cov + d[:, :, None] * d[:, None, :], 1)
    return Gaussian(mean, symmetric(cov))


def joined(mixture: Mixture, most: float) -> Mixture:
    """Pairs joined, the cheapest by (2) first, until the cheapest left costs more than `most`.

    The place that becomes free keeps a copy of the pair, with no weight.
    """
    count = len(mixture.log_weights)
    if count == 1:
        return mixture

    def pair(mixture: Mixture, i: Any, j: Any) -> tuple[Any, Gaussian, Any]:
        """Weight, moments and cost of i and j together; a free place, or a place twice, costs infinitely much."""
        w = jnp.exp(mixture.log_weights[jnp.stack([i, j])])
        both = jax.tree.map(lambda part: part[jnp.stack([i, j])], mixture.each)
        total = jnp.sum(w)
        whole = overall(w / total, both)
        (together, rank), (first, rank_i), (second, rank_j) = map(_log_determinant, (whole.cov, *both.cov))
        cost = (total * together - w[0] * first - w[1] * second) / 2
        free = jnp.all(w > 0) & (i != j) & (rank == jnp.minimum(rank_i, rank_j))
        return total, whole, jnp.where(free, cost, jnp.inf)

    def costs(mixture: Mixture, i: Any) -> Any:
        return jax.vmap(lambda j: pair(mixture, i, j)[2])(jnp.arange(count))

    def join(carry: tuple[Mixture, Any]) -> tuple[Mixture, Any]:
        mixture, cost = carry
        i, j = jnp.unravel_index(jnp.argmin(cost), cost.shape)
        weight, whole, _ = pair(mixture, i, j)
        log_weights = mixture.log_weights.at[i].set(jnp.log(weight)).at[j].set(-jnp.inf)
        each = jax.tree.map(lambda part, new: part.at[i].set(new).at[j].set(new), mixture.each, whole)
        mixture = Mixture(log_weights, each)
        row = costs(mixture, i)
        cost = cost.at[i].set(row).at[:, i].set(row).at[j].set(jnp.inf).at[:, j].set(jnp.inf)
        return mixture, cost

    start = jax.lax.map(lambda i: costs(mixture, i), jnp.arange(count), batch_size=max(1, PAIRS // count))
    return jax.lax.while_loop(lambda carry: jnp.min(carry[1]) < most, join, (mixture, start))[0]


def _log_determinant(P: Any) -> tuple[Any, Any]:
    """Logarithm of the determinant of a covariance in the directions in which something varies, and their number."""
    d = ldl(P).d
    return jnp.sum(jnp.log(jnp.where(d == 0, 1.0, d))), jnp.sum(d != 0)
