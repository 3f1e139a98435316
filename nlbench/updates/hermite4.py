"""Exact update of a fourth-order Hermite prior by a linear measurement.

Prior N(m, P){1 + S:H3/6 + k4:H4/24}. The posterior of e - K z has the moment generating function
exp(t'Omega t/2){1 + S:He3/6 + k4:He4/24}(eta + G't)/(1 + nu), with Hermite polynomials of eta = H'W z with respect to
B = H'W H; the Appell property of He_n gives its cumulants. In measurement space, u = W z, and S, k4 contracted with H
(S1, S2, S3, k1 ... k4h with one to four indices in measurement space):
  (1) He2 = uu - W,  He3 = uuu - 3{u W},  He4 = uuuu - 6{uuW} + 3{W W}
  (2) nu = S3:He3/6 + k4h:He4/24,   kappa = 1/(1 + nu)
  (3) A_a    = S2_ars He2_rs/2 + k3_arst He3_rst/6
      A_ab   = S1_abr u_r + k2_abrs He2_rs/2
      A_abc  = S_abc + k1_abcr u_r
      A_abcd = k_abcd
  (4) a(j) = kappa G...G A(j), one G per index
  (5) m+ = m + K z + a1,  P+ = Omega + a2 - a1 a1,  S+ = a3 - 3{a1 a2} + 2 a1 a1 a1
  (6) k4+ = a4 - 4{a1 a3} - 3{a2 a2} + 2 6{a1 a1 a2} - 6 a1 a1 a1 a1
With k4 = 0, (5) is table 5.1 of Culver 1969 (`hermite3`). Cost O(n^5). Fails where 1 + nu comes near zero.
"""

from __future__ import annotations

from nlbench.algebra import Tensor, einsum, placements
from nlbench.moments.moments import Components
from nlbench.updates.measurement import Gain
from nlbench.updates.posterior import Posterior, through_gain


def hermite4(prior: Components, gain: Gain, z: Tensor, clipped: Tensor) -> Posterior:
    """(1)-(6); the nonlinear terms use the residual `clipped`."""
    H, W, S, k4 = gain.H, gain.W, prior.third, prior.fourth
    u = einsum("rs,s->r", W, clipped)
    he2 = einsum("r,s->rs", u, u) - W  # (1)
    he3 = einsum("r,s,t->rst", u, u, u) - placements(3, "r,st->rst", u, W)
    S1 = einsum("abc,rc->abr", S, H)
    S2 = einsum("abr,sb->ars", S1, H, sym="rs")
    k1 = einsum("abcd,rd->abcr", k4, H)
    k2 = einsum("abcr,sc->abrs", k1, H, sym="ab,rs")
    k3 = einsum("abrs,tb->arst", k2, H, sym="rst")

    A1 = 0.5 * einsum("ars,rs->a", S2, he2) + (1 / 6) * einsum("arst,rst->a", k3, he3)  # (3)
    A2 = einsum("abr,r->ab", S1, u) + 0.5 * einsum("abrs,rs->ab", k2, he2)
    A3 = S + einsum("abcr,r->abc", k1, u)

    nu = _nu(einsum("ars,ta->rst", S2, H, sym="rst"), einsum("arst,qa->rstq", k3, H, sym="rstq"), u, W, he3)
    kappa = 1 / (1 + nu)
    a1, a2, a3, a4 = (kappa * through_gain(gain.G, A) for A in (A1, A2, A3, k4))  # (4)
    mean = prior.mean + einsum("ir,r->i", gain.K, z) + a1  # (5)
    cov = gain.omega + a2 - einsum("i,j->ij", a1, a1)
    third = a3 - placements(3, "i,jk->ijk", a1, a2) + einsum("i,j,k->ijk", a1, a1, a1, times=2.0)
    k4 = a4 - placements(4, "i,jkl->ijkl", a1, a3) - placements(3, "ij,kl->ijkl", a2, a2)  # (6)
    k4 = k4 + 2.0 * placements(6, "i,j,kl->ijkl", a1, a1, a2) - 6.0 * einsum("i,j,k,l->ijkl", a1, a1, a1, a1)
    return Posterior(Components(mean, cov, third, k4), nu)


def _nu(S3: Tensor, k4h: Tensor, u: Tensor, W: Tensor, he3: Tensor) -> object:
    """(2), with k4h:He4 = k4h:uuuu - 6 k4h:uuW + 3 k4h:WW."""
    ku = einsum("rstq,q->rst", k4h, u)
    kuu = einsum("rst,t->rs", ku, u)
    he4 = einsum("rs,r,s->", kuu, u, u) - 6.0 * einsum("rs,rs->", kuu, W)
    he4 = he4 + 3.0 * einsum("rs,rs->", einsum("rstq,tq->rs", k4h, W), W)
    return ((1 / 6) * einsum("rst,rst->", S3, he3) + (1 / 24) * he4)[()]
