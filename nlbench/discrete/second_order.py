"""The equations of second-order filters for noise that need not be additive: Athans's, and those of a Gaussian prior.

With A, L the Jacobians and F_i, G_i, N_i the Hessians (xx, ww, xw) of f_i(k, x, w), and C, D, M_j, Q_j, R_j those of
h_j(k, x, v), all at the estimate and w = v = 0, X the covariance of w and T that of v (Athans 2001, (35)-(47)):
  (1) m-_i = f_i + tr(F_i P)/2 + tr(G_i X)/2,   P- = A P A' + L X L' + c                                 (53)-(55)
  (2) z_j = y_j - h_j - tr(M_j P)/2 - tr(Q_j T)/2,  S = C P C' + D T D' + c',  cov(x, y) = P C'         (56)-(59)
`sof` (Athans): c = c' = 0, so the bias that (1) and (2) take out adds nothing to the covariance. `sof-gaussian`: for
x - m and the noise independent and Gaussian, exact where f and h are quadratic,
  (3) c_ij = tr(F_i P F_j P)/2 + tr(G_i X G_j X)/2 + tr(N_i X N_j' P),  c' likewise of M, Q, R
In continuous time, with the drift's Hessian f_xx and G(t, x) dw:
  (4) dm = f + f_xx:P/2,  dP = F P + P F' + G V G' + c
with c = 0 (`sof`) or c_iq = P_pt V_jl G_ij,p G_ql,t, what (3) becomes for short steps (`sof-gaussian`).
Cost O(n^4). Fails when the third derivatives matter within a standard deviation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete.correction import Gaussian, correct, predicted
from nlbench.discrete.expansion import First, Second, curvature, drift, first, second
from nlbench.discrete.problem import spectrum

if TYPE_CHECKING:
    from nlbench.discrete.problem import Noisy, Observation
    from nlbench.filters.filter import UpdateInfo
    from nlbench.systems.system import System


def step(whole: bool, motion: Noisy, k: Any, prior: Gaussian) -> Gaussian:
    """(1); whole: with (3)."""
    s = len(motion.cov)
    f, hessians = first(motion.function, k, prior.mean, s), second(motion.function, k, prior.mean, s)
    cov = _linear(f, prior.cov, motion.cov)
    if whole:
        cov = cov + _quadratic(hessians, prior.cov, motion.cov)
    return Gaussian(f.value + _bias(hessians, prior.cov, motion.cov), cov)


def slope(whole: bool, system: System, t: Any, prior: Gaussian) -> Gaussian:
    """(4)."""
    mean, P = prior
    f, F = drift(system, t, mean)
    FP = F @ P
    dP = FP + FP.T + spectrum(system, t, mean)
    if whole and system.diffusion is not None:
        diffusion = system.diffusion
        Gx = jax.jacfwd(lambda x: jnp.asarray(diffusion(t, x)))(mean)
        V = jnp.eye(Gx.shape[1]) if system.diffusion_cov is None else jnp.asarray(system.diffusion_cov)
        dP = dP + jnp.einsum("pt,jl,ijp,qlt->iq", P, V, Gx, Gx)
    return Gaussian(f + jnp.einsum("iab,ab->i", curvature(system, t, mean), P) / 2, dP)


def update(whole: bool, seen: Observation, t: Any, prior: Gaussian, y: Any) -> tuple[Gaussian, UpdateInfo]:
    """(2); whole: with (3)."""
    q = len(seen.cov)
    h, hessians = first(seen.function, t, prior.mean, q), second(seen.function, t, prior.mean, q)
    z = seen.innovation(y, h.value + _bias(hessians, prior.cov, seen.cov))
    S = _linear(h, prior.cov, seen.cov)
    if whole:
        S = S + _quadratic(hessians, prior.cov, seen.cov)
    return correct(prior, predicted(seen, y, z, S, prior.cov @ h.x.T), seen.limiter)


def _linear(f: First, P: Any, X: Any) -> Any:
    """A P A' + L X L'."""
    return f.x @ P @ f.x.T + f.w @ X @ f.w.T


def _bias(hessians: Second, P: Any, X: Any) -> Any:
    """tr(F_i P)/2 + tr(G_i X)/2."""
    return (jnp.einsum("iab,ab->i", hessians.xx, P) + jnp.einsum("ipq,pq->i", hessians.ww, X)) / 2


def _quadratic(hessians: Second, P: Any, X: Any) -> Any:
    """(3)."""
    FP, GX = hessians.xx @ P, hessians.ww @ X
    cross = jnp.einsum("iap,pq,jbq,ab->ij", hessians.xw, X, hessians.xw, P)
    return jnp.einsum("iab,jba->ij", FP, FP) / 2 + jnp.einsum("ipq,jqp->ij", GX, GX) / 2 + cross
