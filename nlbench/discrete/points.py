"""Points and weights that integrate over a standard normal vector: unscented, cubature, Gauss-Hermite.

With points xi_i (p, d), weights w_i for means and c_i for covariances,
  E g(xi) ~ sum w_i g(xi_i),   cov(g, h) ~ sum c_i (g_i - E g)(h_i - E h)'
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from nlbench.errors import ConfigError

MOST = 100_000  # points of a product rule


class Points(NamedTuple):
    """at: (p, d). mean, cov: (p,), weights of means and of covariances."""

    at: np.ndarray
    mean: np.ndarray
    cov: np.ndarray


def unscented(d: int, alpha: float, beta: float, kappa: float | None) -> Points:
    """The scaled unscented rule of 2 d + 1 points (Julier and Uhlmann 1997; van der Merwe 2004, 3.2).

    lambda = alpha^2 (d + kappa) - d; points 0 and +-sqrt(d + lambda) on each axis; kappa None is 3 - d for d <= 3,
    which integrates fourth powers on an axis, and else 0, which keeps the central weight from being negative.
    """
    kappa = float(max(3 - d, 0)) if kappa is None else kappa
    scale = alpha**2 * (d + kappa)
    if scale <= 0:
        raise ConfigError(f"ukf.kappa: {kappa} must be above -{d}, minus the number of dimensions")
    axes = np.sqrt(scale) * np.eye(d)
    centre = (scale - d) / scale
    mean = np.concatenate([[centre], np.full(2 * d, 0.5 / scale)])
    cov = mean.copy()
    cov[0] += 1 - alpha**2 + beta
    return Points(np.concatenate([np.zeros((1, d)), axes, -axes]), mean, cov)


def cubature(d: int) -> Points:
    """The spherical-radial rule of third degree: 2 d points +-sqrt(d) on the axes (Arasaratnam and Haykin 2009)."""
    axes = np.sqrt(d) * np.eye(d)
    weights = np.full(2 * d, 0.5 / d)
    return Points(np.concatenate([axes, -axes]), weights, weights)


def gauss_hermite(d: int, count: int) -> Points:
    """The product rule of count^d points, exact for polynomials of degree 2 count - 1 in each variable."""
    if count**d > MOST:
        raise ConfigError(f"points: {count}^{d} = {count**d} points; a product rule takes at most {MOST}")
    x, w = np.polynomial.hermite_e.hermegauss(count)
    weights = np.array([np.prod(each) for each in product(w / w.sum(), repeat=d)])
    return Points(np.array(list(product(x, repeat=d))), weights, weights)
