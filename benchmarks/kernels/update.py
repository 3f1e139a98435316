"""The update by a linear measurement: Kalman's, and table 5.1 of Culver (1969) free of P^-1, on unique components.

  S_z = H P H' + R,  W = S_z^-1,  K = P H' W,  G = I - K H,  eta = H' W z,  B = H' W H,
  O = eta eta - B,  E = eta eta/3 - B,  1/kappa = 1 + S_abc eta_a E_bc/2,
  phi = kappa/2 G_ia S_abc O_bc,  psi = kappa G_ia G_jb S_abc eta_c,
  m+ = m + K z + phi,  P+ = G P + psi - phi phi,
  S+ = kappa G_ia G_jb G_kc S_abc - 3{phi_i (psi - 2/3 phi phi)_jk}.
G is applied to one index of S after the other, and phi and psi are taken from what is formed on the way.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from benchmarks.kernels.tensors import Measured, Posterior, Tensor, at, placements, total, unique
from benchmarks.kernels.trace import Number, Trace


class Gain(NamedTuple):
    """W (m, m), K (n, m) and G (n, n)."""

    W: Tensor
    K: Sequence[Sequence[Number]]
    G: Sequence[Sequence[Number]]


def kalman(trace: Trace, seen: Measured, m: Sequence[Number], P: Tensor) -> tuple[Gain, Posterior]:
    """Mean and covariance by the gain alone."""
    states, rows, H = range(len(m)), range(len(seen.variances)), seen.slope
    PH = [[total(H_a * at(P, i, a) for (s, a), H_a in H.items() if s == r) for r in rows] for i in states]
    S_z = {
        (r, s): total(H_a * PH[a][s] for (row, a), H_a in H.items() if row == r)
        + (seen.variances[r] if r == s else 0.0)
        for r, s in unique(len(rows), 2)
    }
    W = inverse(trace, S_z)
    K = [[total(PH[i][s] * at(W, s, r) for s in rows) for r in rows] for i in states]
    KH = [[total(K[i][r] * H_b for (r, b), H_b in H.items() if b == a) for a in states] for i in states]
    G = [[float(i == a) - KH[i][a] for a in states] for i in states]
    mean = [m[i] + total(K[i][r] * seen.residual[r] for r in rows) for i in states]
    cov = {(i, j): total(G[i][a] * at(P, a, j) for a in states) for i, j in unique(len(m), 2)}
    return Gain(W, K, G), Posterior(mean, cov, {})


def hermite(trace: Trace, seen: Measured, m: Sequence[Number], P: Tensor, S: Tensor) -> Posterior:
    """Table 5.1."""
    (W, _, G), straight = kalman(trace, seen, m, P)
    kappa, kappa_eta, bent = weights(trace, seen, W, S)
    states = range(len(m))
    once = {  # G_ia S_abc, symmetric in b, c
        (i, b, c): total(G[i][a] * at(S, a, b, c) for a in states)
        for i in states
        for b, c in unique(len(m), 2)
    }
    twice = {  # G_ia G_jb S_abc, symmetric in i, j
        (i, j, c): total(G[j][b] * once[i, min(b, c), max(b, c)] for b in states)
        for i, j in unique(len(m), 2)
        for c in states
    }
    phi = [paired(bent, lambda b, c, i=i: once[i, b, c]) for i in states]
    psi = {(i, j): total(twice[i, j, c] * kappa_eta[c] for c in kappa_eta) for i, j in unique(len(m), 2)}
    phi_phi = {(i, j): phi[i] * phi[j] for i, j in psi}
    rest = {ij: psi[ij] - (2 / 3) * phi_phi[ij] for ij in psi}
    third = {
        (i, j, k): kappa * total(G[k][c] * twice[i, j, c] for c in states)
        - placements((i, j, k), lambda i, j, k: phi[i] * at(rest, j, k))
        for i, j, k in unique(len(m), 3)
    }
    mean = [straight.mean[i] + phi[i] for i in states]
    return Posterior(mean, {ij: straight.cov[ij] + (psi[ij] - phi_phi[ij]) for ij in psi}, third)


class Weights(NamedTuple):
    """kappa, kappa eta_a and kappa/2 O_ab (bent), over the states that are measured."""

    kappa: Number
    kappa_eta: Mapping[int, Number]
    bent: Tensor


def weights(trace: Trace, seen: Measured, W: Tensor, S: Tensor) -> Weights:
    """What the residual makes of S."""
    rows, H = range(len(seen.variances)), seen.slope
    u = [total(at(W, r, s) * seen.residual[s] for s in rows) for r in rows]
    eta = {a: total(H_a * u[r] for (r, b), H_a in H.items() if b == a) for a in sorted({a for _, a in H})}
    eta_eta = {(a, b): eta[a] * eta[b] for a in eta for b in eta if a <= b}
    B = {
        (a, b): total(
            H_a * at(W, r, s) * H[s, b] for (r, c), H_a in H.items() if c == a for s in rows if (s, b) in H
        )
        for a, b in eta_eta
    }
    E = {ab: (1 / 3) * eta_eta[ab] - B[ab] for ab in B}
    twice_nu = total(eta[a] * paired(E, lambda b, c, a=a: at(S, a, b, c)) for a in eta)
    kappa = trace.quotient(1.0, 1.0 + 0.5 * twice_nu)
    half = 0.5 * kappa
    return Weights(kappa, {a: kappa * eta[a] for a in eta}, {ab: half * (eta_eta[ab] - B[ab]) for ab in B})


def paired(X: Tensor, Y: Callable[..., Number]) -> Number:
    """X_bc Y_bc for symmetric X, Y, over the entries that X has."""
    return total((X_bc if b == c else 2.0 * X_bc) * Y(b, c) for (b, c), X_bc in X.items())


def inverse(trace: Trace, A: Tensor) -> Tensor:
    """The inverse of a symmetric matrix of one or two rows."""
    if len(A) == 1:
        return {(0, 0): trace.quotient(1.0, A[0, 0])}
    over = trace.quotient(1.0, A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1])
    return {(0, 0): over * A[1, 1], (0, 1): -(over * A[0, 1]), (1, 1): over * A[0, 0]}
