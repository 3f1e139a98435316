"""Bayes's rule by numerical integration, for a measurement of any shape and a prior N(m, P){1 + S:H3/6}.

With nodes x_q = c + root xi_q and a rule of weights w_q against the standard normal,
  (1) log W_q = log w_q + |xi_q|^2/2 - e'P^-1 e/2 - r'R^-1 r/2 + log |root| - log |P|/2,   e = x_q - m,  r = y - h(x_q)
  (2) f_q = 1 + (S:ttt - 3 S:P^-1 t)/6,   t = P^-1 e
  (3) Z = sum W_q f_q,   1 + nu = Z/(sum W_q),   log p(y) = log Z - log |R|/2 - log(2 pi) (entries taken)/2
  (4) m+, P+, S+ = moments of the nodes with weights W_q f_q/Z
`direct`: c = m, root root' = P and even steps over 17 prior standard deviations in each direction: the numerical
integration that Culver 1969, section 5.6, compares with. It needs some three points to a posterior standard deviation.
`quadrature`: c the mode of the Gaussian part of the posterior, root root' = P - K H P linearised there, and
Gauss-Hermite nodes: exact to rounding for a linear measurement from 5 points on, and for a curved one it converges
geometrically. Fails for posteriors of several modes, of which the nodes then see one.
Cost O(points^n); needs a P that is not singular.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, expand, inverse, ldl, log_determinant
from nlbench.algebra.solve import squared_distance
from nlbench.moments.moments import Components
from nlbench.updates.nonlinear import Outcome, Seen
from nlbench.updates.rules import Rule, even, gauss_hermite

ITERATIONS = 20  # of the search for the mode; quadratic near it, so that most stand still
SHORTEST = 1e-3  # of its steps
ROUNDING = 1e-12  # relative, of the cost: so much more does not count as going up


def direct(prior: Components, seen: Seen, points: int = 51) -> Outcome:
    """(1)-(4) over even steps around the prior mean."""
    return integrated(prior, seen, prior.mean, prior.cov, even(prior.mean.shape[0], points))


def quadrature(prior: Components, seen: Seen, points: int = 9) -> Outcome:
    """(1)-(4) over Gauss-Hermite nodes around the mode."""
    centre = mode(prior, seen)
    _, H = _linearised(seen, centre)
    spread = _gain(prior.cov, H, seen.R)[1]
    return integrated(prior, seen, centre, spread, gauss_hermite(prior.mean.shape[0], points))


def integrated(prior: Components, seen: Seen, centre: Tensor, spread: Tensor, rule: Rule) -> Outcome:
    """(1)-(4), with root root' = spread."""
    m, P, S = prior.mean, prior.cov, prior.third
    lower, pivots = ldl(spread)
    root = lower.to_array() * jnp.sqrt(jnp.stack([jnp.asarray(pivot) for pivot in pivots]))
    precision, noise = inverse(P), inverse(seen.R)
    mean, middle = m.to_array(), centre.to_array()

    def at(xi: Any) -> tuple[Any, Any, Any]:
        """e and, but for what all nodes share, log W/w (1) and f (2), at one node."""
        x = middle + root @ xi
        e = Tensor.from_array(x - mean)
        r = Tensor.from_array(seen.residual(x))
        t = einsum("ab,b->a", precision, e)
        distance = einsum("a,a->", t, e) + einsum("rs,r,s->", noise, r, r)
        if S is None:
            return x - mean, 0.5 * (xi @ xi - distance[()]), jnp.ones(())
        bracket = einsum("abc,a,b,c->", S, t, t, t)[()] - 3.0 * einsum("abc,ab,c->", S, precision, t)[()]
        return x - mean, 0.5 * (xi @ xi - distance[()]), 1 + bracket / 6

    e, exponent, f = jax.vmap(at)(jnp.asarray(rule.nodes))
    exponent = exponent + rule.log_weights
    top = jnp.max(exponent)
    W = jnp.exp(exponent - top)
    Z, gaussian = jnp.sum(W * f), jnp.sum(W)  # (3)
    shared = sum(0.5 * jnp.log(pivot) for pivot in pivots) - 0.5 * log_determinant(P)
    shared = shared - 0.5 * (log_determinant(seen.R) + seen.taken * jnp.log(2 * jnp.pi))
    moments = _moments(m, e, W * f / Z, S is not None)
    return Outcome(moments, Z / gaussian - 1, jnp.log(Z) + top + shared)


def _moments(m: Tensor, e: Any, weights: Any, third: bool) -> Components:
    """(4). e: (q, n), from m; weights: (q,), of sum 1."""
    n = m.shape[0]
    shift = [jnp.sum(weights * e[:, i]) for i in range(n)]
    b = [e[:, i] - shift[i] for i in range(n)]
    return Components(
        m + Tensor.symmetric(n, 1, lambda i: shift[i[0]]),
        Tensor.symmetric(n, 2, lambda i: jnp.sum(weights * b[i[0]] * b[i[1]])),
        Tensor.symmetric(n, 3, lambda i: jnp.sum(weights * b[i[0]] * b[i[1]] * b[i[2]])) if third else None,
    )


def mode(prior: Components, seen: Seen) -> Tensor:
    """Where e'P^-1 e + r'R^-1 r is least, by Gauss-Newton steps that are shortened until they descend."""
    m, P = prior.mean.dense(), prior.cov

    def cost(x: Tensor) -> Any:
        r = Tensor.from_array(seen.residual(x.to_array()))
        return squared_distance(P, x - m) + squared_distance(seen.R, r)

    def improved(_: Any, state: tuple[Tensor, Any]) -> tuple[Tensor, Any]:
        x, length = state
        r, H = _linearised(seen, x)
        K, _ = _gain(P, H, seen.R)
        target = m + einsum("ir,r->i", K, r + einsum("ra,a->r", H, x - m))
        tried = (x + length * (target - x)).dense()
        descends = cost(tried) <= (1 + ROUNDING) * cost(x)
        x = jax.tree.map(lambda new, old: jnp.where(descends, new, old), tried, x)
        return x, jnp.where(descends, jnp.minimum(1.0, 2 * length), jnp.maximum(SHORTEST, length / 4))

    return jax.lax.fori_loop(0, ITERATIONS, improved, (m, jnp.ones(())))[0]


def _linearised(seen: Seen, x: Tensor) -> tuple[Tensor, Tensor]:
    """The residual at x and the derivative H of the measurement."""
    r = expand(lambda t, x: seen.residual(x), 0.0, list(x), 1)
    assert r.first is not None
    return r.value, -r.first


def _gain(P: Tensor, H: Tensor, R: Tensor) -> tuple[Tensor, Tensor]:
    """K = P H'(H P H' + R)^-1 and P - K H P."""
    PH = einsum("ia,ra->ir", P, H)
    S_z = einsum("ra,as->rs", H, PH, sym="rs") + R
    K = einsum("is,sr->ir", PH, inverse(S_z))
    return K, P - einsum("ir,jr->ij", K, PH, sym="ij")
