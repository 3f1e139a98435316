"""What Culver's printed equations of order 3 and 4 have beside the corrected ones of `kushner`.

General form (4.67), (4.68), which lacks what the moving mean takes away, and closes mu6 with 10{S S}; summed over r,
  (1) S_ijk'    += u 3{P_ij c_k}
  (2) mu4_ijkl' += u (4{S_ijk c_l} + M_pq 10{S S}_ijklpq),   M_pq 10{S S} = 4{S_ijk M_pq S_lpq} + 2 M_pq 3{S_ijp S_klq}
Scalar form of chapter 7: (7.5) is right, (7.6) has the error of (1), and has lost from mu4' all that Gamma brings save
-4 b c of order 4; with Omega_ij = b_i c_j and linear h,
  (3) mu4_ijkl' -= 6{Omega_ij P_kl} + u 6{P_ij c_kl}
Since the other rates are right, k4' = mu4' - 6{P P'} differs by as much as mu4'. The source steps mu4 itself by the
rectangular rule; as 3{P P} goes to 3{P P} + 6 h {P P'} + 3 h^2 {P' P'} meanwhile, that is for k4 a step with the rate
  (4) k4' - 3 h {P' P'}
whose last term has, in the mean over the noise and as h -> 0, the value of (9) of `kushner`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.algebra import Tensor, einsum, placements
from nlbench.continuous.kushner import told
from nlbench.continuous.sensing import Sensed, curved_residual, total, weighted
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.algebra.scalars import Scalar


def general(order: int, rates: Components, moments: Components, sensed: Sensed) -> Components:
    """The rates with (1) and (2)."""
    if order < 3:
        return rates
    _, P, S, _ = moments
    u = einsum("rs,s->r", sensed.W, curved_residual(sensed, P))
    parts = told(sensed, moments)
    third = [u[r] * placements(3, "ij,k->ijk", P, part.mean) for r, part in enumerate(parts)]  # (1)
    rates = rates._replace(third=rates.third + total(third))
    if order < 4:
        return rates
    fourth = [
        u[r] * (placements(4, "ijk,l->ijkl", S, part.mean) + _squares(S, M))  # (2)
        for r, (part, M) in enumerate(zip(parts, sensed.M, strict=True))
    ]
    return rates._replace(fourth=rates.fourth + total(fourth))


def _squares(S: Tensor, M: Tensor) -> Tensor:
    """M_pq 10{S S}_ijklpq."""
    alone = placements(4, "ijk,l->ijkl", S, einsum("lpq,pq->l", S, M))
    return alone + placements(6, "ijq,klq->ijkl", einsum("ijp,pq->ijq", S, M), S)


def scalar(order: int, rates: Components, moments: Components, sensed: Sensed) -> Components:
    """The rates with the errors of (7.6), for one state and one measurement."""
    if order < 4:
        return rates
    P = moments.cov
    u = einsum("rs,s->r", sensed.W, curved_residual(sensed, P))
    (part,) = told(sensed, moments)
    (b,) = weighted(sensed.W, [part.mean])
    omega = placements(2, "i,j->ij", b, part.mean, times=0.5)
    third = u[0] * placements(3, "ij,k->ijk", P, part.mean)
    fourth = placements(6, "ij,kl->ijkl", omega + u[0] * part.cov, P)  # (3)
    return rates._replace(third=rates.third + third, fourth=rates.fourth - fourth)


def euler_term(rates: Components, h: Scalar) -> Tensor:
    """The last term of (4)."""
    return h * placements(3, "ij,kl->ijkl", rates.cov, rates.cov)
