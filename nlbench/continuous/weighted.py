"""The filter whose nonlinearities are weighed with exp(-k |x - m|^2) (Schwartz 1967, (58)-(72)).

Expansions of f, h and G about the mean m hold near it only; the weight keeps them from growing without bound, k >= 0,
which gives the filter's equations unique solutions. With E of a Gaussian density N(m, P),
  (1) c = E exp(-k |e|^2) = det(2 k P + I)^(-1/2),   P^k = E e e' exp(-k |e|^2) = c P (2 k P + I)^-1     (62), (66)
  (2) nu_r = y_r - h_r - M_r:P^k,   u = W nu,   W = Gamma^-1
  (3) m_i'  = f_i + A_ipq P^k_pq + u_r P^k_ip H_rp                                                      (65)
  (4) P_ij' = 2{F_ip P^k_jp} + G V G' + G_p V G_q' P^2k_pq - (P^k H_r)_i W_rs (P^k H_s)_j + u_r M_r:T_ij/c   (72)
  (5) T_ijpq = (P^k_ij - c P_ij) P^k_pq + P^k_iq P^k_pj + P^k_ip P^k_qj
(66) and (72) as corrected: P^-1 in the former, P^2k and the indices of g in the latter. G_p is the derivative of G in
x_p; G is taken as linear. k = 0 is the Gaussian filter where G does not curve.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, expand, identity, inverse, log_determinant, placements
from nlbench.continuous.second_order import loss, slopes
from nlbench.continuous.sensing import Sensed, curved_residual, total
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.algebra.scalars import Scalar
    from nlbench.systems.system import System


def shrunk(P: Tensor, k: float) -> tuple[Scalar, Tensor]:
    """c and P^k of (1)."""
    widened = identity(P.shape[0]) + 2 * k * P
    c = jnp.exp(-0.5 * log_determinant(widened))
    return c, c * einsum("ia,aj->ij", P, inverse(widened), sym="ij")


def residual(sensed: Sensed, P: Tensor, k: float) -> Tensor:
    """nu of (2): (m,)."""
    return curved_residual(sensed, shrunk(P, k)[1])


def rates(system: System, k: float, t: Scalar, moments: Components, sensed: Sensed | None) -> Components:
    """Derivatives of mean and covariance with y held; `sensed` None: nothing is measured."""
    P = moments.cov
    c, Pk = shrunk(P, k)
    f = expand(system.drift_with_inputs, t, list(moments.mean), 2)
    mean = f.value + einsum("ipq,pq->i", f.second, Pk)  # (3)
    cov = placements(2, "ip,jp->ij", f.first, Pk)  # (4)
    if system.diffusion is not None:
        cov = cov + _diffusion(system, t, moments, shrunk(P, 2 * k)[1])
    if sensed is None:
        return Components(mean, cov)
    u = einsum("rs,s->r", sensed.W, curved_residual(sensed, Pk))
    mean = mean + total([u[r] * gained for r, gained in enumerate(slopes(sensed, Pk))])
    M = total([u[r] * M for r, M in enumerate(sensed.M)])
    return Components(mean, cov - loss(sensed, Pk) + (1 / c) * _curved(M, Pk, P, c))


def _curved(M: Tensor, Pk: Tensor, P: Tensor, c: Scalar) -> Tensor:
    """M_pq T_ijpq of (5)."""
    twice = einsum("iq,qj->ij", einsum("ip,pq->iq", Pk, M), Pk, sym="ij") * 2.0
    return einsum("pq,pq->", M, Pk)[()] * (Pk - c * P) + twice


def _diffusion(system: System, t: Scalar, moments: Components, P2k: Tensor) -> Tensor:
    """G V G' + G_p V G_q' P^2k_pq."""
    assert system.diffusion is not None
    G = expand(system.diffusion, t, list(moments.mean), 1)
    s = G.value.shape[1]
    V = identity(s) if system.diffusion_cov is None else _known(system.diffusion_cov)
    level = einsum("il,jl->ij", einsum("ik,kl->il", G.value, V), G.value, sym="ij")
    half = einsum("ilp,pq->ilq", einsum("ikp,kl->ilp", G.first, V), P2k)
    return level + einsum("ilq,jlq->ij", half, G.first, sym="ij")


def _known(V: object) -> Tensor:
    import numpy as np

    return Tensor.from_array(np.asarray(V, float), ((0, 1),))
