"""Small symmetric matrices in closed form: an unrolled L D L' without pivoting, and what follows from it."""

from __future__ import annotations

from functools import reduce

import jax
import jax.numpy as jnp

from nlbench.algebra.contract import einsum
from nlbench.algebra.scalars import Scalar, add, is_known, multiply
from nlbench.algebra.tensor import Tensor


def ldl(matrix: Tensor) -> tuple[Tensor, list[Scalar]]:
    """L (unit lower triangular) and the diagonal of D with L D L' = matrix, (n, n) symmetric."""
    n = matrix.shape[0]
    lower: dict[tuple[int, int], Scalar] = {}
    pivots: list[Scalar] = []
    for j in range(n):
        column = {k: multiply(lower.get((j, k), 0.0), pivots[k]) for k in range(j)}
        for i in range(j, n):
            rest = matrix[i, j]
            for k in range(j):
                rest = add(rest, multiply(-1.0, multiply(lower.get((i, k), 0.0), column[k])))
            if i == j:
                pivots.append(rest)
                lower[j, j] = 1.0
            else:
                lower[i, j] = 0.0 if is_known(rest) and rest == 0 else rest / pivots[j]
    return Tensor((n, n), ((0,), (1,)), lower), pivots


def inverse(matrix: Tensor) -> Tensor:
    """Inverse of a symmetric matrix with nonzero leading minors."""
    n = matrix.shape[0]
    lower, pivots = ldl(matrix)
    columns: dict[tuple[int, int], Scalar] = {}  # L^-1, by forward substitution
    for j in range(n):
        columns[j, j] = 1.0
        for i in range(j + 1, n):
            terms = (multiply(lower[i, k], columns[k, j]) for k in range(j, i))
            columns[i, j] = multiply(-1.0, reduce(add, terms))
    inverted = Tensor((n, n), ((0,), (1,)), columns)
    weights = Tensor((n, n), ((0, 1),), {(i, i): 1.0 / pivot for i, pivot in enumerate(pivots)})
    return einsum("kl,ki,lj->ij", weights, inverted, inverted, sym="ij")


def squared_distance(matrix: Tensor, vector: Tensor) -> Scalar:
    """v' matrix^-1 v for a symmetric matrix with nonzero leading minors: with w = L^-1 v, the sum of w_i^2/d_i."""
    lower, pivots = ldl(matrix)
    solved: list[Scalar] = []
    total: Scalar = 0.0
    for i, pivot in enumerate(pivots):
        rest = vector[i]
        for k, known in enumerate(solved):
            rest = add(rest, multiply(-1.0, multiply(lower[i, k], known)))
        solved.append(rest)
        total = add(total, multiply(rest, rest) / pivot)
    return total


def log_determinant(matrix: Tensor) -> jax.Array:
    """Logarithm of the determinant of a positive definite matrix; NaN if a pivot is negative."""
    return sum((jnp.log(pivot) for pivot in ldl(matrix)[1]), jnp.zeros(()))


def positive_definite(matrix: Tensor) -> jax.Array:
    """Whether every pivot is positive; false for NaN."""
    return reduce(jnp.logical_and, [jnp.asarray(pivot) > 0 for pivot in ldl(matrix)[1]])
