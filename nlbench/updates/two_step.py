"""The two-step update for a curved measurement: first as if straight, then bent little by little.

With h = h0 + H e + s M ee about the prior mean m0, s = 0 is Kalman's update (second order) or table 5.1 (third); then
s goes to 1 (Culver 1969, (5.70)-(5.89)). There, with e = b + g, g = m - m0, q = M ee and r = z - H e - s M ee,
  (1) l' = q'R^-1 r;  q0 = M gg,  q1 = 2 M g,  r0 = z - H g - s q0,  r1 = -H - s q1
and l' has, to be put into `pseudo_time`, with x~ = R^-1 x,
  (2) value q0 r~0,  first q1 r~0 + q0 r~1,  second M r~0 + 2{q1 r~1}/2 - s q0 M~,
      D3 = 2 3{M_rab (r~1 - s q~1)_rc},  D4 = -8 s 3{M_rab R^-1_rs M_scd}
(5.83)-(5.85). Printed, mu6 has 10{S S} besides and S' lacks -3{P m'}; the second order has no such errors.
nu is that of the first step. Cost O(n^5) a stage of RK4. Fails for bimodal posteriors, and where table 5.1 does.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, inverse, placements
from nlbench.moments.closures import Closure
from nlbench.moments.moments import Components
from nlbench.updates import pseudo_time
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.hermite3 import hermite3
from nlbench.updates.kalman import kalman
from nlbench.updates.nonlinear import Outcome, Seen
from nlbench.updates.pseudo_time import Derivatives, Rates, expected


def two_step(
    prior: Components,
    seen: Seen,
    steps: int = 10,
    equations: str = "corrected",
    closure: Closure | None = None,
) -> Outcome:
    """The moments at s = 1. closure: as for `rates`."""
    straight = (kalman if prior.third is None else hermite3)(prior, seen.gain, seen.z, seen.z)
    M, noise = seen.curvature(), inverse(seen.R)

    def rate(s: Any, moments: Components) -> Rates:
        return rates(s, moments, prior.mean, seen.z, seen.gain.H, M, noise, equations, closure)

    moments, gained = pseudo_time.integrated(rate, straight.moments, steps)
    density = (
        gaussian_log_density(seen.z, seen.gain, seen.taken, seen.slack) + jnp.log1p(straight.nu) + gained
    )
    return Outcome(moments, straight.nu, density)


def rates(
    s: Any,
    moments: Components,
    prior_mean: Tensor,
    z: Tensor,
    H: Tensor,
    M: Tensor,
    noise: Tensor,
    equations: str = "corrected",
    closure: Closure | None = None,
) -> Rates:
    """Rates in pseudo-time. z: residual at the prior mean; noise: R^-1.

    closure: None is the one of the equations: quasi-moment if corrected, cumulant if printed.
    """
    printed = equations == "printed"
    D = derivatives(s, moments, prior_mean, z, H, M, noise)
    found = pseudo_time.rates(moments, D, closure or ("cumulant" if printed else "quasi-moment"))
    if printed and found.moments.third is not None:
        third = found.moments.third + placements(3, "ij,k->ijk", moments.cov, found.moments.mean)
        found = found._replace(moments=found.moments._replace(third=third))
    return found


def derivatives(
    s: Any, moments: Components, prior_mean: Tensor, z: Tensor, H: Tensor, M: Tensor, noise: Tensor
) -> Derivatives:
    """(1)-(2)."""
    g = moments.mean - prior_mean
    Mg = einsum("rab,b->ra", M, g)
    q0, q1 = einsum("ra,a->r", Mg, g), 2.0 * Mg  # (1)
    r0 = z - einsum("ra,a->r", H, g) - s * q0
    r1 = -1.0 * H - s * q1
    r0_, r1_ = einsum("rs,s->r", noise, r0), einsum("rs,sa->ra", noise, r1)
    second = einsum("rab,r->ab", M, r0_ - s * einsum("rs,s->r", noise, q0))  # (2)
    second = second + placements(2, "ra,rb->ab", q1, r1_, times=0.5)
    bent = einsum("rs,sa->ra", noise, r1 - s * q1)
    D3 = placements(3, "rab,rc->abc", M, bent, times=2.0)
    D4 = (-8.0 * s) * placements(3, "rab,rs,scd->abcd", M, noise, M)
    value = einsum("r,r->", q0, r0_)[()]
    first = einsum("ra,r->a", q1, r0_) + einsum("r,ra->a", q0, r1_)
    return expected(value, first, second, D3, D4, moments.cov)
