"""The Kalman filter with sixty digits, for what double precision cannot decide: plain Python, nothing of the package.

Matrices are NumPy arrays of Decimals. Measurements have independent noise and are taken one after the other, so that
nothing is inverted but numbers.
"""

from __future__ import annotations

from decimal import Decimal, getcontext

import numpy as np

getcontext().prec = 60


def extended(array):
    """An array of Decimals, each the exact value of a double."""
    return np.vectorize(Decimal, otypes=[object])(np.asarray(array, float))


def transition(F, D, T):
    """exp(F T) and the integral of exp(F s) D exp(F' s) from 0 to T, by halving and doubling a Taylor series."""
    F, D, T = extended(F), extended(D), Decimal(T)
    halvings = 10
    h = T / 2**halvings
    Phi, Q, power, term = identity(len(F)), h * D, identity(len(F)), h * D
    for k in range(1, 40):
        power = power @ F * h / k
        Phi = Phi + power
        term = (F @ term + term @ F.T) * h / (k + 1)  # Q' = F Q + Q F' + D, Q(0) = 0
        Q = Q + term
    for _ in range(halvings):
        Phi, Q = Phi @ Phi, Phi @ Q @ Phi.T + Q
    return Phi, Q


def identity(n):
    return extended(np.eye(n))


def filtered(Phi, Q, H, R, mean, cov, measurements):
    """Means (T, n) and covariances (T, n, n) after the measurements (T, m), of independent noises R (m,), as doubles
    and Decimals."""
    H, R, mean, cov = extended(H), extended(R), extended(mean), extended(cov)
    means, covs = [], []
    for y in extended(measurements):
        mean, cov = Phi @ mean, Phi @ cov @ Phi.T + Q
        for h, r, value in zip(H, R, y, strict=True):
            seen = cov @ h
            variance = h @ seen + r
            if variance == 0:
                continue
            mean = mean + seen * ((value - h @ mean) / variance)
            cov = cov - np.outer(seen, seen) / variance
        means.append(mean)
        covs.append(cov)
    return np.array(means), np.array(covs)
