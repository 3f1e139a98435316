"""Exact update of a third-order Hermite prior by a linear measurement, and its two suboptimal forms.

Prior N(m, P){1 + S:H3/6}. With the gain of `measurement` and, in measurement space, u = W z, S contracted with H:
S1_abr = S_abc H_rc, S2_ars = S1_abr H_sb, S3_rst = S2_ars H_ta (Culver 1969, table 5.1, free of P^-1):
  (1) nu     = S3_rst u_r (u_s u_t/3 - W_st)/2,   kappa = 1/(1 + nu)
  (2) phi_i  = kappa/2 G_ia S2_ars (u_r u_s - W_rs)
  (3) psi_ij = kappa G_ia G_jb S1_abr u_r
  (4) N_ijk  = kappa G_ia G_jb G_kc S_abc
  (5) m+ = m + K z + phi,   P+ = Omega + psi - phi phi,   S+ = N - 3{phi psi} + 2 phi phi phi
Suboptimal 1 (5.67) keeps m + K z, Omega, N; suboptimal 2 (5.68) keeps m + K z + phi, Omega, N. Cost O(n^4).
Fails when 1 + nu comes near zero: the assumed density is negative there and P+ loses positiveness.
`clipped` is the residual that the nonlinear terms (1)-(4) use.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from nlbench.algebra import Tensor, einsum, placements
from nlbench.moments.moments import Components
from nlbench.updates.measurement import Gain
from nlbench.updates.posterior import Posterior, through_gain


class Terms(NamedTuple):
    """The terms (1)-(4)."""

    nu: Any
    phi: Tensor
    psi: Tensor
    N: Tensor


def terms(S: Tensor, gain: Gain, z: Tensor) -> Terms:
    """(1)-(4)."""
    H = gain.H
    u = einsum("rs,s->r", gain.W, z)
    uu = einsum("r,s->rs", u, u)
    S1 = einsum("abc,rc->abr", S, H)
    S2 = einsum("abr,sb->ars", S1, H, sym="rs")
    S3 = einsum("ars,ta->rst", S2, H, sym="rst")
    nu = 0.5 * einsum("r,r->", einsum("rst,st->r", S3, (1 / 3) * uu - gain.W), u)[()]
    kappa = 1 / (1 + nu)
    phi = (0.5 * kappa) * through_gain(gain.G, einsum("ars,rs->a", S2, uu - gain.W))
    psi = kappa * through_gain(gain.G, einsum("abr,r->ab", S1, u))
    return Terms(nu, phi, psi, kappa * through_gain(gain.G, S))


def hermite3(prior: Components, gain: Gain, z: Tensor, clipped: Tensor) -> Posterior:
    """The optimal update (5)."""
    nu, phi, psi, N = terms(prior.third, gain, clipped)
    mean = prior.mean + einsum("ir,r->i", gain.K, z) + phi
    cov = gain.omega + psi - einsum("i,j->ij", phi, phi)
    third = N - placements(3, "i,jk->ijk", phi, psi) + einsum("i,j,k->ijk", phi, phi, phi, times=2.0)
    return Posterior(Components(mean, cov, third), nu)


def sub1(prior: Components, gain: Gain, z: Tensor, clipped: Tensor) -> Posterior:
    """Suboptimal 1: the Kalman mean and covariance."""
    nu, _, _, N = terms(prior.third, gain, clipped)
    mean = prior.mean + einsum("ir,r->i", gain.K, z)
    return Posterior(Components(mean, gain.omega, N), nu)


def sub2(prior: Components, gain: Gain, z: Tensor, clipped: Tensor) -> Posterior:
    """Suboptimal 2: the Kalman covariance."""
    nu, phi, _, N = terms(prior.third, gain, clipped)
    mean = prior.mean + einsum("ir,r->i", gain.K, z) + phi
    return Posterior(Components(mean, gain.omega, N), nu)
