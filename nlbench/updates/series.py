"""The series update: the likelihood's non-Gaussian part expanded in powers of the error (Culver 1969, appendix F).

Linear measurement, residual z. With L = H'R^-1 H, zeta = H'R^-1 z, K z = d and Omega of the gain,
  (1) g = exp(z'(R^-1 - W) z/2) (|R|/|S_z|)^(1/2)
  (2) G_n:E = sum_b (-1/2)^b/(b! (n - 2b)!) E:zeta^(n-2b) L^b    (F.37; -2 zeta is the source's lambda)
  (3) E3 = S, E4 = k4, E5 = 10{P S}, E6 = 15{P k4}               (printed (F.28): + 10{S S})
  (4) A_j = sum of G_n:E_(n+j) over 3 <= n + j <= 6, n >= 0
  (5) 1 + nu = 1 + A_0/g,   kappa = 1/(1 + nu)
  (6) eps = kappa (d + A_1/g),   m+ = m + eps        (printed (F.37): eps gains (kappa - 1) m)
  (7) P+ = kappa (Omega + dd + A_2/g) - eps eps
  (8) S+ = kappa (3{d Omega} + ddd + A_3/g) - 3{eps P+} - eps eps eps
  (9) k4+ = kappa (3{Omega Omega} + 6{d d Omega} + dddd + A_4/g)
            - 4{eps S+} - 6{eps eps P+} - eps eps eps eps - 3{P+ P+}
(F.37)-(F.41), where (9) is mu4+. The third order has k4 = 0. The printed mean is not invariant under a shift of the
origin. Cost O(n^6). Fails for measurements as accurate as the prior: the series diverges (R below about H P H').
`hermite3` and `hermite4` are its exact limit.
"""

from __future__ import annotations

import math

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, inverse, log_determinant, placements
from nlbench.moments.closures import fifth_moment, gaussian_fourth
from nlbench.moments.moments import Components
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.nonlinear import Outcome, Seen, weighted

LETTERS = "abcdef"


def series(prior: Components, seen: Seen, equations: str = "corrected") -> Outcome:
    """(1)-(9)."""
    gain, z = seen.gain, seen.z
    noise = inverse(seen.R)
    zeta, L = weighted(gain.H, noise, z), einsum("ra,rs,sb->ab", gain.H, noise, gain.H)
    d, omega = einsum("ir,r->i", gain.K, z), gain.omega
    theta = 0.5 * einsum("rs,r,s->", noise - gain.W, z, z)[()]  # (1)
    inverse_g = jnp.exp(0.5 * (log_determinant(gain.variance) - log_determinant(seen.R)) - theta)
    E = {
        order: _contractions(tensor, zeta, L)
        for order, tensor in _coefficients(prior, printed=equations == "printed").items()
    }

    def A(j: int) -> Tensor:  # (4), over g
        parts = [_expanded(contractions, order - j) for order, contractions in E.items() if order >= j]
        return inverse_g * sum(parts[1:], parts[0])

    nu = A(0)[()]  # (5)
    kappa = 1 / (1 + nu)
    eps = kappa * (d + A(1))  # (6)
    if equations == "printed":
        eps = eps + (kappa - 1) * prior.mean
    mean = prior.mean + eps
    eps2 = einsum("i,j->ij", eps, eps)
    cov = kappa * (omega + einsum("i,j->ij", d, d) + A(2)) - eps2  # (7)
    third = placements(3, "i,jk->ijk", d, omega) + einsum("i,j,k->ijk", d, d, d) + A(3)  # (8)
    third = kappa * third - placements(3, "i,jk->ijk", eps, cov) - einsum("i,j,k->ijk", eps, eps, eps)
    fourth = None
    if prior.fourth is not None:
        raw = gaussian_fourth(omega) + placements(6, "i,j,kl->ijkl", d, d, omega)  # (9)
        raw = kappa * (raw + einsum("i,j,k,l->ijkl", d, d, d, d) + A(4))
        fourth = raw - placements(4, "i,jkl->ijkl", eps, third) - placements(6, "i,j,kl->ijkl", eps, eps, cov)
        fourth = fourth - einsum("i,j,k,l->ijkl", eps, eps, eps, eps) - gaussian_fourth(cov)
    density = gaussian_log_density(z, gain, seen.taken, seen.slack) + jnp.log1p(nu)
    return Outcome(Components(mean, cov, third, fourth), nu, density)


def _coefficients(prior: Components, printed: bool) -> dict[int, Tensor]:
    """(3), by order."""
    P, S, k4 = prior.cov, prior.third, prior.fourth
    assert S is not None
    E = {3: S, 5: fifth_moment(P, S)}
    sixth = None if k4 is None else placements(15, "ij,klmn->ijklmn", P, k4)
    if k4 is not None:
        E[4] = k4
    if printed:
        squares = placements(10, "ijk,lmn->ijklmn", S, S)
        sixth = squares if sixth is None else sixth + squares
    if sixth is not None:
        E[6] = sixth
    return E


def _contractions(E: Tensor, zeta: Tensor, L: Tensor) -> dict[tuple[int, int], Tensor]:
    """E:zeta^a L^b of a symmetric tensor, by (a, b), for all that its indices suffice for."""
    order = len(E.shape)
    found = {(0, 0): E}
    for b in range(order // 2 + 1):
        if b:
            found[0, b] = _contracted(found[0, b - 1], L)
        for a in range(1, order - 2 * b + 1):
            found[a, b] = _contracted(found[a - 1, b], zeta)
    return found


def _expanded(contractions: dict[tuple[int, int], Tensor], n: int) -> Tensor:
    """(2): n of the indices contracted with G_n."""
    terms = [
        ((-0.5) ** b / (math.factorial(b) * math.factorial(n - 2 * b))) * contractions[n - 2 * b, b]
        for b in range(n // 2 + 1)
    ]
    return sum(terms[1:], terms[0])


def _contracted(E: Tensor, with_: Tensor) -> Tensor:
    """The last indices of a symmetric tensor contracted with all of another."""
    letters = LETTERS[: len(E.shape)]
    left = letters[: len(letters) - len(with_.shape)]
    return einsum(f"{letters},{letters[len(left) :]}->{left}", E, with_, sym=left if len(left) > 1 else "")
