"""Densities that are a Gaussian times a series of Hermite polynomials (Gram and Charlier's series A).

With z = (e - mean)/deviation, phi and Phi the standard normal density and distribution, He_n the polynomials orthogonal
under phi:
  (1) p(e) = phi(z) (1 + sum_{n>=3} c_n/n! He_n(z))/deviation,   c_n = mean of He_n(z)
  (2) P(e) = Phi(z) - c_3/3! He_2(z) phi(z),                     of the third order alone, c_3 being the skewness
The central moments up to the last n are those of e, since He_n is orthogonal to every polynomial of a lower order. The
density may be negative somewhere (Culver 1969, chapter 2).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import hermite_e

WIDTH = 0.005  # of variances that are taken as one, relative
_erf = np.vectorize(math.erf, otypes=[float])


def normal(z: np.ndarray) -> np.ndarray:
    """The standard normal density."""
    return np.exp(-0.5 * z**2) / math.sqrt(2 * math.pi)


def coefficients(z: np.ndarray, order: int) -> np.ndarray:
    """c_n/n! of (1) for n = 0 ... order, from values z of mean 0 and variance 1."""
    unit = np.eye(order + 1)
    return np.array([hermite_e.hermeval(z, unit[n]).mean() / math.factorial(n) for n in range(order + 1)])


def density(z: np.ndarray, series: np.ndarray) -> np.ndarray:
    """(1) for deviation 1, with the coefficients c_n/n!."""
    return normal(z) * hermite_e.hermeval(z, series)


def matched(errors: np.ndarray, at: np.ndarray, order: int) -> np.ndarray:
    """(1) with the mean and the central moments of the errors up to an order."""
    mean, deviation = errors.mean(), errors.std()
    return density((at - mean) / deviation, coefficients((errors - mean) / deviation, order)) / deviation


def average(variance: np.ndarray, third: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Between each two edges, the mean of the third-order densities about zero with these moments, one of each run.

    Means over the cells, from (2), so that the narrowest density has its whole weight. Runs whose variances differ by
    less than `WIDTH` are taken together, with the mean of their third moments, in which the density is linear.
    """
    _, group, size = np.unique(np.round(np.log(variance) / WIDTH), return_inverse=True, return_counts=True)
    variance, third = (np.bincount(group, weights=each) / size for each in (variance, third))
    deviation = np.sqrt(variance)
    z = edges / deviation[:, None]
    skewness = (third / deviation**3)[:, None]
    distribution = 0.5 * (1 + _erf(z / math.sqrt(2))) - skewness / 6 * (z**2 - 1) * normal(z)  # (2)
    return size @ np.diff(distribution) / size.sum() / np.diff(edges)
