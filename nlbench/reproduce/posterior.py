"""The posterior of a Hermite density of third order after a linear measurement: by the filter, and by Bayes' rule."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NODES = (
    4  # of Gauss-Hermite quadrature, exact to degree 7: third moments times a cubic density are of degree 6
)


class Hermite(NamedTuple):
    """A Hermite density of third order, and a linear measurement of it: z = v - h, matrix H, noise covariance."""

    P: np.ndarray
    third: np.ndarray
    H: np.ndarray
    noise: np.ndarray
    z: np.ndarray


def example(n: int, r: int, seed: int) -> Hermite:
    """A random one of n states and r measurements."""
    random = np.random.default_rng((seed, n, r))

    def covariance(size: int) -> np.ndarray:
        root = random.normal(size=(size, size))
        return root @ root.T + np.eye(size)

    P, H, noise = covariance(n), random.normal(size=(r, n)), covariance(r)
    root = np.linalg.cholesky(P)
    cubic = random.normal(size=(n, n, n))
    symmetric = sum(
        np.transpose(cubic, each)
        for each in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0))
    )
    third = 0.04 * np.einsum("abc,ia,jb,kc->ijk", symmetric, root, root, root)
    z = np.linalg.cholesky(H @ P @ H.T + noise) @ random.normal(size=r)
    return Hermite(P, third, H, noise, z)


def error(case: Hermite) -> float:
    """The largest difference between filter and quadrature, relative to the largest moment of that order."""
    pairs = zip(_by_the_filter(case), _by_quadrature(case), strict=True)
    return max(float(np.abs(a - b).max() / np.abs(b).max()) for a, b in pairs)


def _by_the_filter(case: Hermite) -> tuple[np.ndarray, ...]:
    """Posterior mean, covariance and third moments of the filter, from a prior mean of zero."""
    import jax.numpy as jnp

    from nlbench import filters
    from nlbench.moments.moments import Moments
    from nlbench.systems.system import System

    n = len(case.P)
    system = System(
        drift=lambda t, x: jnp.zeros(n),
        observe=lambda t, x: jnp.asarray(case.H) @ x,
        measurement_cov=case.noise,
        initial=Moments(np.zeros(n), case.P, case.third),
    )
    built = filters.build("third-order", system)
    state, _ = built.update(built.init(system.initial), 0.0, case.z)
    moments = built.moments(state)
    return tuple(np.asarray(each) for each in (moments.mean, moments.cov, moments.third))


def _by_quadrature(case: Hermite) -> tuple[np.ndarray, ...]:
    """The same by Bayes' rule: prior times likelihood is a normal density times 1 + mu_3 He_3/6, a cubic in x."""
    P, third, H, noise, z = case
    precision = np.linalg.inv(P) + H.T @ np.linalg.inv(noise) @ H
    cov = np.linalg.inv(precision)
    centre = cov @ H.T @ np.linalg.inv(noise) @ z
    nodes, weights = np.polynomial.hermite_e.hermegauss(NODES)
    grid = np.stack(np.meshgrid(*[nodes] * len(P), indexing="ij"), -1).reshape(-1, len(P))
    weight = np.prod(np.meshgrid(*[weights] * len(P), indexing="ij"), axis=0).reshape(-1)
    x = centre + grid @ np.linalg.cholesky(cov).T
    u = x @ np.linalg.inv(P)
    contracted = np.einsum("abc,bc->a", third, np.linalg.inv(P))
    weight = weight * (1 + (np.einsum("abc,sa,sb,sc->s", third, u, u, u) - 3 * u @ contracted) / 6)
    weight = weight / weight.sum()
    mean = weight @ x
    e = x - mean
    return mean, np.einsum("s,si,sj->ij", weight, e, e), np.einsum("s,si,sj,sk->ijk", weight, e, e, e)
