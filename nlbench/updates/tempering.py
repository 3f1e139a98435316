"""The integration update: the likelihood is let in little by little (Culver 1969, appendix G).

p_s is proportional to p_0 exp(s l), l = -(y - h)'R^-1 (y - h)/2, and s goes from 0 to 1. With h = h0 + H e + M ee
about the prior mean m0, g = m - m0 and b = x - m, the residual is r0 - Hb b - M bb with
  (1) r0 = z - H g - M g g,   Hb = H + 2 M g
and l has, to be put into `pseudo_time`,
  (2) value -r0'R^-1 r0/2,  first Hb'R^-1 r0,  second M'R^-1 r0 - Hb'R^-1 Hb/2,
      D3 = -2 3{Hb_ra R^-1_rs M_sbc},  D4 = -4 3{M_rab R^-1_rs M_scd}
Printed (G.21), linear h, is without the term S_iab D_ab/2 of the mean, the Wong-Zakai correction of the Ito equations
that (G.21) was read off from:
  (3) m' = P Hb'R^-1 r0
The state is the prior's moments, of order 3 or 4 (4 for linear h only). Cost O(n^5) a stage of RK4, four stages a step.
Fails where the density loses positiveness, and for accurate measurements in few steps.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, inverse, log_determinant, placements
from nlbench.moments.moments import Components
from nlbench.updates import pseudo_time
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.nonlinear import Outcome, Seen, weighted
from nlbench.updates.pseudo_time import Derivatives, Rates, expected


def tempering(
    prior: Components,
    seen: Seen,
    steps: int | None = None,
    measurement: str = "linear",
    equations: str = "corrected",
) -> Outcome:
    """The moments at s = 1. measurement: "linear" leaves M out, "quadratic" keeps it."""
    M = seen.curvature() if measurement == "quadratic" else None
    noise = inverse(seen.R)

    def rate(s: Any, moments: Components) -> Rates:
        return rates(moments, prior.mean, seen.z, seen.gain.H, M, noise, equations)

    let_in = information(prior.cov, seen.gain.H, M, noise) if steps is None else 0.0
    moments, gained = pseudo_time.integrated(rate, prior, steps, let_in)
    log_density = gained - 0.5 * (log_determinant(seen.R) + seen.taken * jnp.log(2 * jnp.pi))
    nu = jnp.expm1(log_density - gaussian_log_density(seen.z, seen.gain, seen.taken, seen.slack))
    return Outcome(moments, nu, log_density)


def rates(
    moments: Components,
    prior_mean: Tensor,
    z: Tensor,
    H: Tensor,
    M: Tensor | None,
    noise: Tensor,
    equations: str = "corrected",
) -> Rates:
    """Rates in pseudo-time. z: residual at the prior mean; noise: R^-1; M: None if linear."""
    g = moments.mean - prior_mean
    if M is None:
        D = linear(z - einsum("ra,a->r", H, g), H, noise, moments.cov)
    else:
        Mg = einsum("rab,b->ra", M, g)
        r0 = z - einsum("ra,a->r", H, g) - einsum("ra,a->r", Mg, g)  # (1)
        D = quadratic(r0, H + 2.0 * Mg, M, noise, moments.cov)
    found = pseudo_time.rates(moments, D)
    if equations == "printed":
        mean = einsum("ia,a->i", moments.cov, D.first)  # (3)
        found = found._replace(moments=found.moments._replace(mean=mean))
    return found


def information(P: Tensor, H: Tensor, M: Tensor | None, noise: Tensor) -> Any:
    """Compute the variance of h, over that of the noise: tr((H P H' + 2 M P M P) R^-1)."""
    found = einsum("ra,ab,sb,rs->", H, P, H, noise)[()]
    if M is not None:
        MP = einsum("rac,cb->rab", M, P)
        found = found + 2.0 * einsum("rab,sba,rs->", MP, MP, noise)[()]
    return jnp.asarray(found, float)


def linear(r0: Tensor, H: Tensor, noise: Tensor, P: Tensor) -> Derivatives:
    """(2) with M = 0."""
    second = -1.0 * einsum("ra,rs,sb->ab", H, noise, H)
    value = -0.5 * einsum("rs,r,s->", noise, r0, r0)[()] + 0.5 * einsum("ab,ab->", second, P)[()]
    return Derivatives(value, weighted(H, noise, r0), second)


def quadratic(r0: Tensor, Hb: Tensor, M: Tensor, noise: Tensor, P: Tensor) -> Derivatives:
    """(2)."""
    weighted_r0 = einsum("rs,s->r", noise, r0)
    second = einsum("rab,r->ab", M, weighted_r0) - 0.5 * einsum("ra,rs,sb->ab", Hb, noise, Hb)
    D3 = placements(3, "ra,rbc->abc", einsum("rs,ra->sa", noise, Hb), M, times=-2.0)
    D4 = placements(3, "rab,rs,scd->abcd", M, noise, M, times=-4.0)
    value = -0.5 * einsum("r,r->", weighted_r0, r0)[()]
    return expected(value, einsum("ra,r->a", Hb, weighted_r0), second, D3, D4, P)
