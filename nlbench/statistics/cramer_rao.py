"""The posterior Cramer-Rao bound: what no filter's mean squared error can be below (Tichavsky et al. 1998).

For x+ = f(x) + w and y = h(x) + v with normal w, v of covariances Q, R, the bound P of E e e' follows from expectations
over the true states, with F = df/dx, H = dh/dx:
  (1) transition:  P+ = Q + E[F] (P^-1 + C)^-1 E[F]',  C = E[F' Q^-1 F] - E[F]' Q^-1 E[F]
  (2) measurement: P+ = (P^-1 + E[H' R^-1 H])^-1
(1) is Tichavsky's (21) with D11 = E[F' Q^-1 F], D12 = -E[F]' Q^-1, D22 = Q^-1, in a form that holds for a singular Q
too, with its pseudo-inverse, as long as F only varies where Q has noise. Without any process noise, what is known of
x(t) comes from x(0) alone (van Trees 1968, 2.4.3), with Phi = dx(t)/dx(0):
  (3) P(t) = E[Phi] (P0^-1 + sum E[Phi' H' R^-1 H Phi])^-1 E[Phi]'
P0 may be singular. The initial state is normal. Bounds are of errors without regard to bias given the data.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

OUTSIDE = 1e-9  # of the square of F: more than rounding


class Transition(NamedTuple):
    """Expectations over the true states at a step: E[F], E[F' Q^-1 F] with the pseudo-inverse, and the mean square of
    what of F lies outside the range of Q; with Q."""

    F: np.ndarray
    information: np.ndarray
    outside: float
    Q: np.ndarray


def gained(P: np.ndarray, information: np.ndarray) -> np.ndarray:
    """(P^-1 + information)^-1, P singular or not: (2)."""
    found = P @ np.linalg.inv(np.eye(len(P)) + information @ P)
    return (found + found.T) / 2


def moved(P: np.ndarray, step: Transition) -> np.ndarray:
    """(1). Raises `ValueError` where F varies outside the range of Q, where C is infinite."""
    F, Q = step.F, step.Q
    inverse = np.linalg.pinv(Q, hermitian=True)
    fixed = F - Q @ inverse @ F
    if step.outside - np.sum(fixed**2) > OUTSIDE * max(np.sum(F**2), step.outside):
        raise ValueError("the transition is nonlinear in states that have no noise")
    C = step.information - F.T @ inverse @ F
    found = Q + F @ gained(P, (C + C.T) / 2) @ F.T
    return (found + found.T) / 2


def carried(P0: np.ndarray, information: np.ndarray, flow: np.ndarray) -> np.ndarray:
    """(3), from the information on the initial state."""
    return flow @ gained(P0, information) @ flow.T
