"""Square roots of covariances, and what is done with them instead of with covariances.

P = L L' is positive semidefinite whatever rounding does to L, and a small variance beside a large one keeps its digits
in L, since L's entries are standard deviations: variances whose ratio is 1e16 are apart by 1e8 only. So Gaussian
filters carry a mean and a root, and what makes a covariance, F P F' + Q say, is columns side by side, [F L, Q^1/2]:
  (1) sum of outer products of the columns = T T',  T lower triangular, by orthogonalising the rows (`triangular`)
With rows of the measurement above those of the state, T is all that an update needs (Kaminski, Bryson and Schmidt
1971, IEEE Trans. Automatic Control 16, 727-736):
  (2) [[D, H L], [0, L]] -> [[S^1/2, 0], [K S^1/2, L+]]
A direction in which nothing varies has a pivot that rounding leaves at some eps of what it came from: it is put to
zero, and its column with it, so that known states and exact measurements are cases like any other.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp


def triangular(columns: Any) -> Any:
    """Return the lower triangular T (r, r) of (1), its diagonal not negative, for columns (r, c).

    By the modified Gram-Schmidt method, whose triangular factor is as accurate as that of Householder's reflections
    (Bjorck 1967, BIT 7, 1-21). A row that is a combination of those above has a pivot of zero.
    """
    r, c = columns.shape
    least = (r + c) * jnp.finfo(columns.dtype).eps * jnp.sqrt(jnp.sum(columns**2, 1))
    rest, found = columns, []
    for j in range(r):
        length = jnp.sqrt(jnp.sum(rest[0] ** 2))
        nil = length <= least[j]
        direction = jnp.where(nil, 0.0, rest[0] / jnp.where(nil, 1.0, length))
        along = jnp.sum(rest * direction, 1)
        rest = rest[1:] - along[1:, None] * direction
        found.append(jnp.concatenate([jnp.zeros(j, columns.dtype), along]))
    return jnp.stack(found, 1)


class Pivots(NamedTuple):
    """P = U diag(d) U': U (n, n) unit lower triangular, d (n,), zero where nothing varies."""

    U: Any
    d: Any


def ldl(P: Any) -> Pivots:
    """Decompose a symmetric matrix (n, n) without pivoting; a pivot within rounding of zero is zero."""
    n = len(P)
    least = n * jnp.finfo(P.dtype).eps * jnp.abs(jnp.diagonal(P))
    rest, columns, pivots = P, [], []
    for j in range(n):
        nil = jnp.abs(rest[0, 0]) <= least[j]
        below = jnp.where(nil, 0.0, rest[1:, 0] / jnp.where(nil, 1.0, rest[0, 0]))
        pivots.append(jnp.where(nil, 0.0, rest[0, 0]))
        columns.append(jnp.concatenate([jnp.zeros(j, P.dtype), jnp.ones(1, P.dtype), below]))
        rest = rest[1:, 1:] - below[:, None] * rest[0, 1:]
    return Pivots(jnp.stack(columns, 1), jnp.stack(pivots))


def square_root(P: Any) -> Any:
    """Return the lower triangular L (n, n) with L L' = P, which may be singular; NaN where P is not a covariance."""
    U, d = ldl(P)
    return U * jnp.sqrt(d)


def nonnegative_root(P: Any) -> Any:
    """Return the root (n, n) of a covariance, or of what is left of another symmetric matrix when the directions that
    count negatively are left out."""
    columns, signs = _signed_columns(P)
    return triangular(jnp.where(signs > 0, columns, 0.0))


def absolute_root(P: Any) -> Any:
    """Return the root (n, n) of a covariance, or of another symmetric matrix with all directions counted positively."""
    return triangular(_signed_columns(P)[0])


def _signed_columns(P: Any) -> tuple[Any, Any]:
    """P = sum of signs_j c_j c_j', columns c (n, n) and signs (n,), by decomposition with the largest diagonal entry
    first."""
    n = len(P)
    least = n * jnp.finfo(P.dtype).eps * jnp.max(jnp.abs(P))
    rest, columns, signs = P, [], []
    for _ in range(n):
        diagonal = jnp.diagonal(rest)
        place = jnp.argmax(jnp.abs(diagonal))
        pivot = diagonal[place]
        nil = jnp.abs(pivot) <= least
        columns.append(jnp.where(nil, 0.0, rest[:, place] / jnp.sqrt(jnp.where(nil, 1.0, jnp.abs(pivot)))))
        signs.append(jnp.sign(pivot))
        rest = rest - signs[-1] * columns[-1][:, None] * columns[-1]
    return jnp.stack(columns, 1), jnp.stack(signs)


def solved(L: Any, b: Any) -> Any:
    """Solve L x = b for a lower triangular L (m, m) and b (m,) or (m, k); x is zero where L has a pivot of zero."""
    rows: list[Any] = []
    for r in range(len(L)):
        rest = b[r] - sum(L[r, s] * rows[s] for s in range(r))
        nil = L[r, r] == 0
        rows.append(jnp.where(nil, 0.0, rest / jnp.where(nil, 1.0, L[r, r])))
    return jnp.stack(rows)


def quotient(N: Any, T: Any) -> Any:
    """Solve F T = N for a lower triangular T (n, n) and N (k, n); a column of F is zero where T has a pivot of zero."""
    n = len(T)
    columns: dict[int, Any] = {}
    for j in reversed(range(n)):
        rest = N[:, j] - sum(columns[k] * T[k, j] for k in range(j + 1, n))
        nil = T[j, j] == 0
        columns[j] = jnp.where(nil, 0.0, rest / jnp.where(nil, 1.0, T[j, j]))
    return jnp.stack([columns[j] for j in range(n)], 1)
