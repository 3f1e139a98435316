"""The equations of second-order filters for noise that need not be additive: Athans's, and those of a Gaussian prior.

With A, L the Jacobians and F_i, G_i, N_i the Hessians (xx, ww, xw) of f_i(k, x, w), and C, D, M_j, Q_j, R_j those of
h_j(k, x, v), all at the estimate and w = v = 0, X the covariance of w and T that of v (Athans 2001, (35)-(47)):
  (1) m-_i = f_i + tr(F_i P)/2 + tr(G_i X)/2,   P- = A P A' + L X L' + c                                 (53)-(55)
  (2) z_j = y_j - h_j - tr(M_j P)/2 - tr(Q_j T)/2,  S = C P C' + D T D' + c',  cov(x, y) = P C'         (56)-(59)
`sof` (Athans): c = c' = 0, so the bias that (1) and (2) take out adds nothing to the covariance. `sof-gaussian`: for
x - m and the noise independent and Gaussian, exact where f and h are quadratic,
  (3) c_ij = tr(F_i P F_j P)/2 + tr(G_i X G_j X)/2 + tr(N_i X N_j' P),  c' likewise of M, Q, R
In continuous time, with the drift's Hessian f_xx and G(t, x) dw, for `propagation`:
  (4) dm = f + f_xx:P/2,  dP = F P + P F' + G V G' + c
with c = 0 (`sof`) or c_iq = P_pt V_jl G_ij,p G_ql,t, what (3) becomes for short steps (`sof-gaussian`).
Cost O(n^4). Fails when the third derivatives matter within a standard deviation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete.correction import Spread, conditioned, factor, joint, symmetric
from nlbench.discrete.expansion import Second, curvature, drift, first, second
from nlbench.discrete.problem import density_root, noise_columns
from nlbench.discrete.propagation import Local
from nlbench.discrete.roots import square_root

if TYPE_CHECKING:
    from nlbench.discrete.problem import Noisy, Observation
    from nlbench.filters.filter import UpdateInfo
    from nlbench.systems.system import System


def step(whole: bool, motion: Noisy, k: Any, prior: Spread) -> Spread:
    """(1); whole: with (3)."""
    s, L, B = len(motion.cov), prior.root, square_root(motion.cov)
    f, hessians = first(motion.function, k, prior.mean, s), second(motion.function, k, prior.mean, s)
    noise = _noise(whole, f.w @ B, hessians, prior.cov, motion.cov)
    return Spread(f.value + _bias(hessians, prior.cov, motion.cov), factor(f.x @ L, noise))


def local(whole: bool, system: System, t: Any, mean: Any, columns: Any) -> Local:
    """(4)."""
    f, F = drift(system, t, mean)
    f = f + jnp.einsum("iab,ap,bp->i", curvature(system, t, mean), columns, columns) / 2
    g = noise_columns(system, t, mean)
    if whole and system.diffusion is not None:
        diffusion = system.diffusion
        Gx = jax.jacfwd(lambda x: jnp.asarray(diffusion(t, x)))(mean)
        changes = jnp.einsum("ijp,jl,pc->icl", Gx, density_root(system, Gx.shape[1]), columns)
        g = jnp.concatenate([g, changes.reshape(len(mean), -1)], 1)
    return Local(f, F, g)


def update(whole: bool, seen: Observation, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
    """(2); whole: with (3)."""
    q, L, B = len(seen.cov), prior.root, square_root(seen.cov)
    h, hessians = first(seen.function, t, prior.mean, q), second(seen.function, t, prior.mean, q)
    z = seen.innovation(y, h.value + _bias(hessians, prior.cov, seen.cov))
    noise = _noise(whole, h.w @ B, hessians, prior.cov, seen.cov)
    return conditioned(prior, joint(seen, y, z, noise, h.x @ L, L), seen.limiter)


def _bias(hessians: Second, P: Any, X: Any) -> Any:
    """tr(F_i P)/2 + tr(G_i X)/2."""
    return (jnp.einsum("iab,ab->i", hessians.xx, P) + jnp.einsum("ipq,pq->i", hessians.ww, X)) / 2


def _noise(whole: bool, linear: Any, hessians: Second, P: Any, X: Any) -> Any:
    """The columns that are independent of x - m: those of the noise, and with `whole` a root of (3)."""
    if not whole:
        return linear
    FP, GX = hessians.xx @ P, hessians.ww @ X
    cross = jnp.einsum("iap,pq,jbq,ab->ij", hessians.xw, X, hessians.xw, P)
    c = jnp.einsum("iab,jba->ij", FP, FP) / 2 + jnp.einsum("ipq,jqp->ij", GX, GX) / 2 + cross
    return jnp.concatenate([linear, square_root(symmetric(c))], 1)
