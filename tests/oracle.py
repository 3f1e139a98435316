"""Oracles for the core in plain NumPy and SciPy: every answer comes from a definition, none from the package.

A Hermite (Gram-Charlier) density is the Gaussian N(m, P) times 1 + S:H3/6 + k4:H4/24; its expectations
are Gauss-Hermite sums, its Bayes posterior a trapezoid sum, its time derivatives come from the generator.
"""

from __future__ import annotations

from functools import reduce
from itertools import combinations_with_replacement, permutations, product
from typing import NamedTuple

import numpy as np


class Density(NamedTuple):
    """A signed density as nodes and weights that sum to one, exact for polynomials up to its degree."""

    nodes: np.ndarray
    weights: np.ndarray

    def mean_of(self, g):
        return np.tensordot(self.weights, np.array([g(x) for x in self.nodes]), axes=1)


class Posterior(NamedTuple):
    mean: np.ndarray
    cov: np.ndarray
    third: np.ndarray
    fourth: np.ndarray
    evidence: float


def rng(seed):
    return np.random.default_rng(seed)


def random_cov(generator, n, scale=1.0):
    a = generator.normal(size=(n, n + 2))
    return scale * a @ a.T / (n + 2)


def symmetrise(tensor):
    """Mean over all index permutations."""
    axes = list(permutations(range(np.ndim(tensor))))
    return sum(np.transpose(tensor, p) for p in axes) / len(axes)


def outer(*factors):
    return reduce(np.multiply.outer, factors)


def placements(count, *factors):
    """count{...}: sum of the `count` distinct index placements of a product of symmetric tensors."""
    return count * symmetrise(outer(*factors))


def he3(eta, b):
    return outer(eta, eta, eta) - placements(3, eta, b)


def he4(eta, b):
    return outer(eta, eta, eta, eta) - placements(6, b, eta, eta) + placements(3, b, b)


def fourth_moment(cov, k4=None):
    gaussian = placements(3, cov, cov)
    return gaussian if k4 is None else gaussian + k4


def hermite_factor(e, cov, third=None, k4=None):
    """1 + S:H3(e)/6 + k4:H4(e)/24 with the Hermite polynomials of N(0, P)."""
    inverse = np.linalg.inv(cov)
    eta = inverse @ e
    value = 1.0
    if third is not None:
        value += np.sum(third * he3(eta, inverse)) / 6
    if k4 is not None:
        value += np.sum(k4 * he4(eta, inverse)) / 24
    return value


def gaussian_pdf(e, cov):
    return np.exp(-0.5 * e @ np.linalg.solve(cov, e)) / np.sqrt(np.linalg.det(2 * np.pi * cov))


def hermite_density(mean, cov, third=None, k4=None, points=9):
    """The density as a Gauss-Hermite rule, exact for polynomial expectations up to degree 2 points - 5."""
    x, w = np.polynomial.hermite_e.hermegauss(points)
    n, root = len(mean), np.linalg.cholesky(cov)
    errors = [root @ np.array(xi) for xi in product(x, repeat=n)]
    weights = np.array([np.prod(wi) for wi in product(w / w.sum(), repeat=n)])
    factors = np.array([hermite_factor(e, cov, third, k4) for e in errors])
    return Density(np.array([mean + e for e in errors]), weights * factors)


def central_moments(density, mean=None):
    """Mean and central moments 2, 3, 4 of a density."""
    mean = density.mean_of(lambda x: x) if mean is None else mean
    powers = [density.mean_of(lambda x, k=k: outer(*[x - mean] * k)) for k in (2, 3, 4)]
    return mean, *powers


def moment_rates(density, mean, drift, diffusion_cov):
    """Time derivatives of mean and central moments 2, 3, 4 from the generator f.grad + D:grad grad / 2.

    d/dt E g(x - m) = E[L g(x - m)] - E[grad g(x - m)] . dm/dt; diffusion_cov(x) is G V G^T.
    """
    dm = density.mean_of(drift)

    def rate(order):
        def integrand(x):
            e, f, d = x - mean, drift(x) - dm, diffusion_cov(x)
            value = order * outer(*[e] * (order - 1), f)
            if order >= 2:
                value = value + order * (order - 1) / 2 * outer(*[e] * (order - 2), d)
            return symmetrise(value)

        return density.mean_of(integrand)

    return dm, rate(2), rate(3), rate(4)


def bayes(mean, cov, third, k4, observe, noise_cov, y, points=49, width=11.0):
    """Posterior moments of a Hermite prior and y = observe(x) + N(0, R), by trapezoid sums over a dense grid.

    The grid is laid out on the Gauss-Newton posterior; the weights are prior times likelihood by definition.
    A trapezoid sum of a Gaussian with .46 standard deviations between points is exact to rounding.
    """
    n, inverse_noise = len(mean), np.linalg.inv(noise_cov)
    centre = np.array(mean, dtype=float)
    for _ in range(20):
        slope = jacobian(observe, centre)
        information = np.linalg.inv(cov) + slope.T @ inverse_noise @ slope
        pull = slope.T @ inverse_noise @ (y - observe(centre)) - np.linalg.solve(cov, centre - mean)
        centre = centre + np.linalg.solve(information, pull)
    root = np.linalg.cholesky(np.linalg.inv(information))
    axis = np.linspace(-width, width, points)
    nodes = [centre + root @ np.array(xi) for xi in product(axis, repeat=n)]
    weights = np.array([_joint(x, mean, cov, third, k4, observe, noise_cov, y) for x in nodes])
    cell = (axis[1] - axis[0]) ** n * np.linalg.det(root)
    evidence = weights.sum() * cell
    m, p, s, mu4 = central_moments(Density(np.array(nodes), weights / weights.sum()))
    return Posterior(m, p, s, mu4, evidence)


def _joint(x, mean, cov, third, k4, observe, noise_cov, y):
    e = x - mean
    prior = gaussian_pdf(e, cov) * hermite_factor(e, cov, third, k4)
    return prior * gaussian_pdf(y - observe(x), noise_cov)


def jacobian(g, x, step=1e-6):
    """Central differences."""
    columns = [(g(x + step * u) - g(x - step * u)) / (2 * step) for u in np.eye(len(x))]
    return np.stack(columns, axis=-1)


def kalman_update(mean, cov, h, noise_cov, z):
    """Information form, which shares no step with a gain-based implementation; needs invertible P."""
    inverse_noise = np.linalg.inv(noise_cov)
    posterior = np.linalg.inv(np.linalg.inv(cov) + h.T @ inverse_noise @ h)
    return mean + posterior @ h.T @ inverse_noise @ z, posterior


def rk4(rate, value, t0, t1, steps):
    """Classical Runge-Kutta over [t0, t1] for a flat vector."""
    dt = (t1 - t0) / steps
    for i in range(steps):
        t = t0 + i * dt
        k1 = rate(t, value)
        k2 = rate(t + dt / 2, value + dt / 2 * k1)
        k3 = rate(t + dt / 2, value + dt / 2 * k2)
        k4 = rate(t + dt, value + dt * k3)
        value = value + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return value


def kalman_predict_rk4(mean, cov, f, offset, q, t0, t1, steps):
    """RK4 of dm = F m + c, dP = F P + P F^T + Q."""
    n = len(mean)

    def rate(_, v):
        m, p = v[:n], v[n:].reshape(n, n)
        return np.concatenate([f @ m + offset, (f @ p + p @ f.T + q).ravel()])

    v = rk4(rate, np.concatenate([mean, np.ravel(cov)]), t0, t1, steps)
    return v[:n], v[n:].reshape(n, n)


def unique(order, n):
    return list(combinations_with_replacement(range(n), order))
