"""Autonomous moment equations of order 1 to 4: how the moments change between measurements.

System dx = f dt + G dw with E dw dw' = V dt. About the mean m, with e = x - m,
  f_i = f_i + F_ie e_e + A_ief e_e e_f,      D_ij = (G V G')_ij = D_ij + D'_ijp e_p + D''_ijpq e_p e_q.
Culver 1969, (4.64)-(4.68) without measurements; the terms in D', D'' follow from the same expectations.
  (1) m_i'    = f_i + A_ief P_ef
  (2) P_ij'   = 2{F_ie P_je + A_ief S_jef} + D_ij + D''_ijpq P_pq
  (3) S_ijk'  = 3{F_ie S_jke + A_ief k4_jkef + T_ijf P_kf + D'_ijp P_kp + D''_ijpq S_kpq},   T_ijf = 2 A_ief P_je
  (4) k4_ijkl' = 4{F_ie k4_jkle} + 12{T_ijf S_klf} + 6{D'_ijp S_klp + D''_ijpq (k4_klpq + 2 P_kp P_lq)}
(4) is the source's equation of mu4 less the derivative of 3{P P}, with mu5 = 10{P S}. Of A_ief mu5_jklef that leaves
T_ijf S_klf alone: A_ief P_ef S_jkl is in (1) and A_ief S_lef P_jk in (2), and these cancel, as the terms in F and D do.
Order 1 is (1)-(2) without A, D' and D'' (the linearised, or extended, Kalman filter); order 2 has S = 0; order 3 has
k4 = 0; order 4 has a fifth coefficient of zero.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.algebra import Taylor, Tensor, einsum, expand, placements
from nlbench.algebra.scalars import Scalar
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
        return Components(f.value, _covariance(f, D, moments))
    T = None if order == 2 else einsum("ief,je->ijf", f.second, moments.cov, times=2.0)
    return Components(
        f.value + einsum("ief,ef->i", f.second, moments.cov),  # (1)
        _covariance(f, D, moments),
        None if order < 3 else _third(f, D, T, moments),
        None if order < 4 else _fourth(f, D, T, moments),
    )


def fourth_moment_rate(moments: Components, rates: Components) -> Tensor:
    """Derivative of mu4 = k4 + 3{P P}, given the derivatives of the components."""
    return rates.fourth + placements(6, "ij,kl->ijkl", moments.cov, rates.cov)


def _covariance(f: Taylor, D: Taylor | None, moments: Components) -> Tensor:
    P, S = moments.cov, moments.third
    half = einsum("ie,je->ij", f.first, P)  # (2)
    if S is not None:
        half = half + einsum("ief,jef->ij", f.second, S)
    rate = placements(2, "ij->ij", half)
    if D is None:
        return rate
    return rate + D.value if D.second is None else rate + D.value + einsum("ijpq,pq->ij", D.second, P)


def _third(f: Taylor, D: Taylor | None, T: Tensor, moments: Components) -> Tensor:
    P, S, k4 = moments.cov, moments.third, moments.fourth
    third = einsum("ie,jke->ijk", f.first, S) + einsum("ijf,kf->ijk", T, P, sym="jk")  # (3)
    if k4 is not None:
        third = third + einsum("ief,jkef->ijk", f.second, k4)
    rate = placements(3, "ijk->ijk", third)
    if D is None:
        return rate
    return rate + placements(
        3, "ijk->ijk", einsum("ijp,kp->ijk", D.first, P) + einsum("ijpq,kpq->ijk", D.second, S)
    )


def _fourth(f: Taylor, D: Taylor | None, T: Tensor, moments: Components) -> Tensor:
    P, S, k4 = moments.cov, moments.third, moments.fourth
    rate = placements(4, "ie,jkle->ijkl", f.first, k4) + placements(12, "ijf,klf->ijkl", T, S)  # (4)
    if D is None:
        return rate
    rate = rate + placements(6, "ijp,klp->ijkl", D.first, S) + placements(6, "ijpq,klpq->ijkl", D.second, k4)
    half = einsum("ijpq,kp->ijkq", D.second, P, sym="ij")
    return rate + placements(6, "ijkl->ijkl", einsum("ijkq,lq->ijkl", half, P, sym="ij,kl"), times=2.0)
