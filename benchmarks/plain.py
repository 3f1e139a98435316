"""The layout that everyone writes: arrays, jacfwd and hessian, einsum, a scan, and vmap over trajectories.

Nothing here is tuned, and no use is made of symmetry or of zeros.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from benchmarks.workloads import Workload


def third_order(workload: Workload) -> Callable[[Any], tuple[Any, Any, Any]]:
    """Measurements (trajectories, times, m) -> mean, covariance and third moment after each update."""
    f = lambda x: workload.drift(jnp, x)  # noqa: E731
    n = len(workload.mean)

    def rates(moments):
        m, P, S = moments
        F, A = jax.jacfwd(f)(m), jax.hessian(f)(m) / 2
        dm = f(m) + jnp.einsum("ief,ef->i", A, P)
        X = jnp.einsum("ie,je->ij", F, P) + jnp.einsum("ief,jef->ij", A, S)
        Y = jnp.einsum("ie,jke->ijk", F, S) + 2 * jnp.einsum("ief,je,kf->ijk", A, P, P)
        return dm, X + X.T, symmetrised(Y)

    def update(moments, y):
        m, P, S = moments
        H, z, W = linearised(workload, m, P, y)
        K = P @ H.T @ W
        G = jnp.eye(n) - K @ H
        eta, B = H.T @ W @ z, H.T @ W @ H
        O, E = jnp.outer(eta, eta) - B, jnp.outer(eta, eta) / 3 - B  # noqa: E741
        kappa = 1 / (1 + jnp.einsum("abc,a,bc->", S, eta, E) / 2)
        phi = kappa / 2 * jnp.einsum("ia,abc,bc->i", G, S, O)
        psi = kappa * jnp.einsum("abc,a,ib,jc->ij", S, eta, G, G)
        N = kappa * jnp.einsum("abc,ia,jb,kc->ijk", S, G, G, G)
        third = (
            N - symmetrised(jnp.einsum("i,jk->ijk", phi, psi)) + 2 * jnp.einsum("i,j,k->ijk", phi, phi, phi)
        )
        return m + K @ z + phi, G @ P + psi - jnp.outer(phi, phi), third

    start = (jnp.asarray(workload.mean), jnp.asarray(workload.cov), jnp.zeros((n, n, n)))
    return filtered(workload, rates, update, start)


def ekf(workload: Workload) -> Callable[[Any], tuple[Any, Any]]:
    """Measurements (trajectories, times, m) -> mean and covariance after each update."""
    f = lambda x: workload.drift(jnp, x)  # noqa: E731

    def rates(moments):
        m, P = moments
        FP = jax.jacfwd(f)(m) @ P
        return f(m), FP + FP.T

    def update(moments, y):
        m, P = moments
        H, z, W = linearised(workload, m, P, y)
        K = P @ H.T @ W
        return m + K @ z, P - K @ H @ P

    return filtered(workload, rates, update, (jnp.asarray(workload.mean), jnp.asarray(workload.cov)))


def linearised(workload: Workload, m: Any, P: Any, y: Any) -> tuple[Any, Any, Any]:
    """H, the residual, and the inverse of the innovation covariance."""
    H = jax.jacfwd(lambda x: workload.observe(jnp, x))(m)
    z = y - workload.observe(jnp, m)
    if workload.wrapped:
        z = z - 2 * jnp.pi * jnp.round(z / (2 * jnp.pi))
    return H, z, jnp.linalg.inv(H @ P @ H.T + workload.noise_cov)


def symmetrised(T: Any) -> Any:
    """3{T}, for T symmetric in its last two indices."""
    return T + T.transpose(1, 0, 2) + T.transpose(1, 2, 0)


def filtered(workload: Workload, rates: Callable, update: Callable, start: Any) -> Callable:
    """The compiled filter of many trajectories."""

    def moved(x, h, k):
        return jax.tree.map(lambda x, k: x + h * k, x, k)

    def rk4(x):
        h = workload.step
        k1 = rates(x)
        k2 = rates(moved(x, h / 2, k1))
        k3 = rates(moved(x, h / 2, k2))
        k4 = rates(moved(x, h, k3))
        return jax.tree.map(lambda x, a, b, c, d: x + h / 6 * (a + 2 * b + 2 * c + d), x, k1, k2, k3, k4)

    def to_next_measurement(x, y):
        x = jax.lax.fori_loop(0, workload.steps, lambda _, x: rk4(x), x)
        x = update(x, y)
        return x, x

    return jax.jit(jax.vmap(lambda y: jax.lax.scan(to_next_measurement, start, y)[1]))
