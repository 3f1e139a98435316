"""The truncated second-order filter as Henriksen corrects it, and the two forms that he corrects.

For x+ = f(k, x) + G(k, x) w and y = h(k, x) + v, with Q1_iq = P_pt V_jl G_ij,p G_ql,t, Q2_iq = P_pt V_jl G_ij,pt G_ql
and the biases b_i = f_i,ab P_ab, b_r = h_r,ab P_ab, all at the estimate (Henriksen 1980, (18)-(23)):
  (1) m- = f + b/2,   P- = F P F' + G V G' + Q1 + (Q2 + Q2')/2 + c
  (2) z = y - h - b/2,  S = H P H' + W + c',  cov(x, y) = P H',  P+ = P - P H' S^-1 H P + C
`truncated`: c = c' = C = 0. The erroneous filters keep c = -b b'/4 and c' = -b b'/4, the squares of means whose
counterparts of fourth order they drop, (11): the covariance can become negative. `truncated-jazwinski` also has the
random forcing
  (3) C = -P (b' S^-1 z)/2,
the leading term of what the source leaves to Jazwinski 1970; `modified-jazwinski` has none.
In continuous time c and c' vanish with the step, and the three propagate alike:
  (4) dm = f + f_xx:P/2,  dP = F P + P F' + G V G' + Q1 + (Q2 + Q2')/2
G is the Jacobian of the transition in w at w = 0, and of h likewise its D, W = D R D'; what else noise does in a
transition that is not linear in it is left out. State: mean and covariance. Cost O(n^4).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete import gaussian
from nlbench.discrete.correction import Gaussian, correct, gains, limited, predicted, symmetric
from nlbench.discrete.expansion import curvature, drift, first, second
from nlbench.discrete.problem import spectrum

if TYPE_CHECKING:
    from nlbench.discrete.problem import Noisy, Observation
    from nlbench.filters.filter import Filter, UpdateInfo
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """`truncated`, `truncated-jazwinski` or `modified-jazwinski`."""
    erroneous = name != "truncated"
    forced = name == "truncated-jazwinski"
    return gaussian.build_with_covariance(
        name, system, options, partial(step, erroneous), slope, partial(update, erroneous, forced)
    )


def step(erroneous: bool, motion: Noisy, k: Any, prior: Gaussian) -> Gaussian:
    """(1)."""
    s = len(motion.cov)
    f = first(motion.function, k, prior.mean, s)
    b = jnp.einsum("iab,ab->i", second(motion.function, k, prior.mean, s).xx, prior.cov)

    def G(x: Any) -> Any:
        return first(motion.function, k, x, s).w

    cov = f.x @ prior.cov @ f.x.T + _spread(G, prior, motion.cov)
    if erroneous:
        cov = cov - jnp.outer(b, b) / 4
    return Gaussian(f.value + b / 2, cov)


def slope(system: System, t: Any, prior: Gaussian) -> Gaussian:
    """(4)."""
    f, F = drift(system, t, prior.mean)
    FP = F @ prior.cov
    noise = spectrum(system, t, prior.mean)
    if system.diffusion is not None:
        diffusion = system.diffusion
        G = lambda x: jnp.asarray(diffusion(t, x))  # noqa: E731
        s = jnp.shape(G(prior.mean))[1]
        V = jnp.eye(s) if system.diffusion_cov is None else jnp.asarray(system.diffusion_cov)
        noise = _spread(G, prior, V)
    b = jnp.einsum("iab,ab->i", curvature(system, t, prior.mean), prior.cov)
    return Gaussian(f + b / 2, FP + FP.T + noise)


def _spread(G: Callable, prior: Gaussian, V: Any) -> Any:
    """G V G' + Q1 + (Q2 + Q2')/2, the covariance of G(x) w to second order in x - m."""
    mean, P = prior
    at, Gx = G(mean), jax.jacfwd(G)(mean)
    Gxx = jax.jacfwd(jax.jacfwd(G))(mean)
    Q1 = jnp.einsum("pt,jl,ijp,qlt->iq", P, V, Gx, Gx)
    Q2 = jnp.einsum("pt,jl,ijpt,ql->iq", P, V, Gxx, at)
    return at @ V @ at.T + Q1 + symmetric(Q2)


def update(
    erroneous: bool, forced: bool, seen: Observation, t: Any, prior: Gaussian, y: Any
) -> tuple[Gaussian, UpdateInfo]:
    """(2)."""
    q = len(seen.cov)
    h = first(seen.function, t, prior.mean, q)
    b = jnp.einsum("rab,ab->r", second(seen.function, t, prior.mean, q).xx, prior.cov)
    z = seen.innovation(y, h.value + b / 2)
    C = prior.cov @ h.x.T
    S = h.x @ C + h.w @ seen.cov @ h.w.T
    if erroneous:
        S = S - jnp.outer(b, b) / 4
    foretold = predicted(seen, y, z, S, C)
    posterior, info = correct(prior, foretold, seen.limiter)
    if not forced:
        return posterior, info
    # An entry that was not taken has z = 0, and so does its element of S^-1 z.
    z, _, b = gains(foretold._replace(C=b[None]), limited(foretold, seen.limiter))
    pull = (b.T @ z)[0]
    return posterior._replace(cov=posterior.cov - prior.cov * pull / 2), info  # (3)
