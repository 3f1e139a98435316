"""Filters of continuous measurements of order 2, 3 and 4 from Kushner's equation (Culver 1969, (4.64)-(4.74)).

System dx = f dt + G dw, measured as dz = h dt + noise of spectral density Gamma; h = h + H_r e + M_r:ee about the mean.
What the measurement r tells of the n-th moments is its covariance c with their products, less what the moving mean
takes away; with W = Gamma^-1 and nu_r = y_r - h_r - M_r:P,
  (1) c_i    = H_p P_ip + M_pq S_ipq
  (2) c_ij   = H_p S_ijp + M_pq (k4_ijpq + 2 P_ip P_jq)
  (3) g_ijk  = H_p k4_ijkp + 2 M_pq 3{P_ip S_jkq}                       cov(eee, h) - 3{P_ij c_k}, mu5 = 10{P S}
  (4) g_ijkl = 2 M_pq 4{P_ip k4_jklq} - 4{S_ijk M_pq S_lpq}             cov(eeee, h) - 4{S_ijk c_l} - 6{P_ij c_kl}
To the autonomous rates of `moments.equations` is added, summed over r with u_r = W_rs nu_s and b_i = W_rs c_i of s,
  (5) m_i'     += u c_i
  (6) P_ij'    += u c_ij - b_i c_j
  (7) S_ijk'   += u g_ijk - 3{b_i c_jk}
  (8) k4_ijkl' += u g_ijkl - 4{b_i g_jkl}
(7) and (8) are the source's (4.67) and (4.68) corrected, the latter for k4 = mu4 - 3{P P} by the ordinary chain rule.
In Ito's sense the rule has a further term, which a step of Euler must have for k4:
  (9) k4_ijkl' -= 3{c_ij W c_kl}
Order 2 has S = k4 = 0 and is (4.69)-(4.70), the filter of the Gaussian density; order 3 has k4 = 0.
On a linear system with a Gaussian start S and k4 stay exactly zero, and the filter is Kalman's and Bucy's.
Cost O(m n^(order + 1)). Fails when steps are so long that P loses positiveness.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nlbench.algebra import Tensor, einsum, placements
from nlbench.continuous.sensing import Sensed, curved_residual, total, weighted
from nlbench.moments.equations import rates as autonomous_rates
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.algebra.scalars import Scalar
    from nlbench.systems.system import System


class Told(NamedTuple):
    """(1)-(4) of one measurement; None beyond the order."""

    mean: Tensor
    cov: Tensor
    third: Tensor | None
    fourth: Tensor | None


def told(sensed: Sensed, moments: Components) -> list[Told]:
    """(1)-(4), for each measurement."""
    return [_told(H, M, moments) for H, M in zip(sensed.H, sensed.M, strict=True)]


def _told(H: Tensor, M: Tensor, moments: Components) -> Told:
    _, P, S, k4 = moments
    PM = einsum("ip,pq->iq", P, M)
    c1 = einsum("p,ip->i", H, P)
    c2 = einsum("iq,jq->ij", PM, P, sym="ij") * 2.0
    if S is None:
        return Told(c1, c2, None, None)
    SM = einsum("ipq,pq->i", S, M)
    c1, c2 = c1 + SM, c2 + einsum("p,ijp->ij", H, S)  # (1)
    g3 = placements(3, "iq,jkq->ijk", PM, S, times=2.0)
    if k4 is None:
        return Told(c1, c2, g3, None)
    c2 = c2 + einsum("pq,ijpq->ij", M, k4)  # (2)
    g3 = g3 + einsum("p,ijkp->ijk", H, k4)  # (3)
    g4 = placements(4, "iq,jklq->ijkl", PM, k4, times=2.0) - placements(4, "ijk,l->ijkl", S, SM)  # (4)
    return Told(c1, c2, g3, g4)


def rates(system: System, order: int, t: Scalar, moments: Components, sensed: Sensed | None) -> Components:
    """Derivatives of the moments with y held, by the ordinary rules of calculus; `sensed` None: nothing is measured."""
    found = autonomous_rates(system, order, t, moments)
    if sensed is None:
        return found
    m, P, S, k4 = found
    parts = told(sensed, moments)
    u = einsum("rs,s->r", sensed.W, curved_residual(sensed, moments.cov))
    b = weighted(sensed.W, [part.mean for part in parts])
    for r, (c1, c2, g3, g4) in enumerate(parts):
        m = m + u[r] * c1  # (5)
        P = P + u[r] * c2 - placements(2, "i,j->ij", b[r], c1, times=0.5)  # (6)
        if g3 is not None:
            S = S + u[r] * g3 - placements(3, "i,jk->ijk", b[r], c2)  # (7)
        if g4 is not None:
            k4 = k4 + u[r] * g4 - placements(4, "i,jkl->ijkl", b[r], g3)  # (8)
    return Components(m, P, S, k4)


def ito_term(moments: Components, sensed: Sensed) -> Tensor:
    """3{c_ij W c_kl} of (9)."""
    cov = [part.cov for part in told(sensed, moments)]
    pairs = zip(cov, weighted(sensed.W, cov), strict=True)
    return total([placements(6, "ij,kl->ijkl", c, w, times=0.5) for c, w in pairs])
