"""Weighted points that stand for a standard normal law: a spherical-radial rule with random orientations.

A normal u is r v, |v| = 1, with r^2/2 of the gamma law of shape n/2, so that, for n dimensions,
  (1) r_k = sqrt(2 g_k) with the weights p_k: Gauss's rule for that law (generalised Laguerre), by the eigenvalues and
      eigenvectors of its Jacobi matrix, a_i = 2 i + n/2, b_i = sqrt(i (i - 1 + n/2)) (Golub and Welsch 1969)
  (2) v_j: the axes, each end with weight 1/(n (n + 2)), and the corners of the cube, each n/(2^n (n + 2)): a rule of
      fifth degree for the sphere (Stroud 1971); for n = 4 the 24-cell
  (3) u = r_k Q v_j, with a random rotation Q for every r_k (Genz and Monahan 1998)
Polynomials of the fifth degree are integrated exactly; more turns average out the rest over directions, and more radii
over distances (r^18 is exact for five). The outermost points are far out, with small weights: for n = 4, 5.3 standard
deviations with five radii and 8 with ten.
"""

from __future__ import annotations

import math
from itertools import product
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np


class Points(NamedTuple):
    """u (n, N) and the logarithms of the weights (N,), whose sum is 1."""

    u: Any
    log_weights: Any


def normal_points(key: Any, n: int, radii: int, turns: int) -> Points:
    """N = radii x turns x (2 n + 2^n) points: for each radius, the directions turned so many times."""
    r, radial = _radii(n, radii)
    v, angular = _directions(n)
    Q = jnp.linalg.qr(jax.random.normal(key, (turns, radii, n, n)))[0]
    u = jnp.einsum("k,tkab,bj->atkj", r, Q, v)
    weights = radial[:, None] * angular / turns
    return Points(u.reshape(n, -1), jnp.broadcast_to(jnp.log(weights), u.shape[1:]).reshape(-1))


def _radii(n: int, count: int) -> tuple[Any, Any]:
    """(1): r (count,), p (count,)."""
    i = np.arange(count)
    side = np.sqrt(i * (i - 1 + n / 2))[1:]
    gamma, vectors = np.linalg.eigh(np.diag(2 * i + n / 2) + np.diag(side, 1) + np.diag(side, -1))
    return np.sqrt(2 * gamma), np.square(vectors[0])


def _directions(n: int) -> tuple[Any, Any]:
    """(2): v (n, 2 n + 2^n) and their weights."""
    corners = np.array(list(product((-1, 1), repeat=n))).T / math.sqrt(n)
    weights = [np.full(2 * n, 1 / (n * (n + 2))), np.full(2**n, n / (2**n * (n + 2)))]
    return np.concatenate([np.eye(n), -np.eye(n), corners], axis=1), np.concatenate(weights)
