"""Autonomous moment equations of order 1 to 4: how the moments change between measurements.

System dx = f dt + G dw with E dw dw' = V dt. About the mean m, with e = x - m,
  f_i = f_i + F_ie e_e + A_ief e_e e_f,      D_ij = (G V G')_ij = D_ij + D'_ijp e_p + D''_ijpq e_p e_q.
Culver 1969, (4.64)-(4.68) without measurements; the terms in D', D'' follow from the same expectations.
  (1) m_i'    = f_i + A_ief P_ef
  (2) P_ij'   = 2{F_ie P_je} + B_ij + D_ij + D''_ijpq P_pq,    B_ij = 2{A_ief S_jef}
  (3) S_ijk'  = 3{F_ie S_jke + A_ief (k4_jkef + 2 P_je P_kf)} + 3{D'_ijp P_kp + D''_ijpq S_kpq}
  (4) k4_ijkl' = 4{F_ie k4_jkle + A_ief (mu5_jklef - S_jkl P_ef)} - 6{B_ij P_kl}
                 + 6{D'_ijp S_klp + D''_ijpq (k4_klpq + 2 P_kp P_lq)}
(4) is the source's equation of mu4 less the derivative of 3{P P}, where the terms in F and D cancel. Order 1 is (1)-(2)
without A, D' and D'' (the linearised, or extended, Kalman filter); order 2 has S = 0; order 3 has k4 = 0; order 4 has
mu5 = 10{P S}.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.algebra import Taylor, Tensor, einsum, expand, placements
from nlbench.algebra.scalars import Scalar
from nlbench.moments.closures import fifth_moment
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.systems.system import System


def rates(system: System, order: int, t: Scalar, moments: Components) -> Components:
    """Time derivatives of the moments under the equations of the given order (1 to 4)."""
    mean = list(moments.mean)
    curved = 1 if order == 1 else 2
    f = expand(system.drift_with_inputs, t, mean, curved)
    D = None
    if system.diffusion is not None:
        D = expand(system.diffusion_spectrum, t, mean, 0 if order == 1 else 2, symmetry=((0, 1),))
    if order == 1:
        return Components(f.value, _linear_covariance(f, D, moments.cov))
    a = einsum("ief,ef->i", f.second, moments.cov)
    B = None if moments.third is None else placements(2, "ief,jef->ij", f.second, moments.third)
    return Components(
        f.value + a,  # (1)
        _covariance(f, D, B, moments.cov),
        None if order < 3 else _third(f, D, moments),
        None if order < 4 else _fourth(f, D, a, B, moments),
    )


def fourth_moment_rate(moments: Components, rates: Components) -> Tensor:
    """Derivative of mu4 = k4 + 3{P P}, given the derivatives of the components."""
    return rates.fourth + placements(6, "ij,kl->ijkl", moments.cov, rates.cov)


def _linear_covariance(f: Taylor, D: Taylor | None, P: Tensor) -> Tensor:
    rate = placements(2, "ie,je->ij", f.first, P)
    return rate if D is None else rate + D.value


def _covariance(f: Taylor, D: Taylor | None, B: Tensor | None, P: Tensor) -> Tensor:
    rate = _linear_covariance(f, D, P)  # (2)
    if B is not None:
        rate = rate + B
    return rate if D is None else rate + einsum("ijpq,pq->ij", D.second, P)


def _third(f: Taylor, D: Taylor | None, moments: Components) -> Tensor:
    P, S, k4 = moments.cov, moments.third, moments.fourth
    rate = placements(3, "ie,jke->ijk", f.first, S)  # (3)
    rate = rate + placements(3, "ijk->ijk", _twice(f.second, P), times=2.0)
    if k4 is not None:
        rate = rate + placements(3, "ief,jkef->ijk", f.second, k4)
    if D is None:
        return rate
    return rate + placements(3, "ijp,kp->ijk", D.first, P) + placements(3, "ijpq,kpq->ijk", D.second, S)


def _twice(A: Tensor, P: Tensor) -> Tensor:
    """A_ief P_je P_kf, one index at a time."""
    return einsum("ijf,kf->ijk", einsum("ief,je->ijf", A, P), P, sym="jk")


def _fourth(f: Taylor, D: Taylor | None, a: Tensor, B: Tensor, moments: Components) -> Tensor:
    P, S, k4 = moments.cov, moments.third, moments.fourth
    rate = placements(4, "ie,jkle->ijkl", f.first, k4) - placements(4, "i,jkl->ijkl", a, S)  # (4)
    rate = rate + placements(4, "ief,jklef->ijkl", f.second, fifth_moment(P, S))
    rate = rate - placements(6, "ij,kl->ijkl", B, P)
    if D is None:
        return rate
    rate = rate + placements(6, "ijp,klp->ijkl", D.first, S) + placements(6, "ijpq,klpq->ijkl", D.second, k4)
    half = einsum("ijpq,kp->ijkq", D.second, P, sym="ij")
    return rate + placements(6, "ijkl->ijkl", einsum("ijkq,lq->ijkl", half, P, sym="ij,kl"), times=2.0)
