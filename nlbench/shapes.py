"""Arrays as systems state them and functions return them: taken as they are meant, or said to be wrong.

A number stands for a matrix of one entry or a vector of one, integers and truth values for floats.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

Shape = tuple[int | None, ...]  # None for any extent
ROUNDING = 1e-9  # relative, below which a negative eigenvalue is none


def as_rank(array: Any, rank: int) -> Any:
    """Return a number as an array of that rank, lists and integers as arrays of floats, and anything else as it is."""
    if array is None or isinstance(array, str):
        return array
    exact = isinstance(array, jax.Array) and not jnp.issubdtype(array.dtype, jnp.inexact)
    if isinstance(array, jax.core.Tracer):
        array = array.astype(float) if exact else array
    elif exact or not isinstance(array, jax.Array):
        try:
            array = np.asarray(array, float)
        except (TypeError, ValueError):
            return array
    return array.reshape((1,) * rank) if array.size == 1 and array.ndim < rank else array


def as_moments(moments: Any) -> Any:
    """Return moments with numbers as arrays, as `as_rank` does; what are no moments stays."""
    if not hasattr(moments, "_fields"):
        return moments
    return type(moments)(*(as_rank(part, rank) for rank, part in enumerate(moments, 1)))


@dataclass(frozen=True)
class Floats:
    """A function of a system whose result is an array of floats of a rank; such an array itself is left as it is."""

    function: Callable
    rank: int

    def __call__(self, *arguments: Any) -> Any:
        y = self.function(*arguments)
        if isinstance(y, (tuple, list)) and all(np.ndim(part) == 0 for part in y if part is not None):
            return tuple(_floating(part) for part in y)
        if not isinstance(y, (jax.Array, np.ndarray, np.generic, bool, int, float)):
            return y
        y = _floating(y)
        if jnp.ndim(y) == self.rank:
            return y
        if jnp.ndim(y) == 0:
            return jnp.reshape(y, (1,) * self.rank)
        return y[:, None] if jnp.ndim(y) == 1 and self.rank == 2 else y  # one noise


def _floating(y: Any) -> Any:
    """Return y, as a float where it is an integer or a truth value."""
    return jnp.asarray(y, float) if not jnp.issubdtype(jnp.result_type(y), jnp.inexact) else y


def as_floats(function: Any, rank: int) -> Any:
    """Return the function with results as `Floats` says; None and what is no function stay."""
    return (
        function
        if function is None or isinstance(function, Floats) or not callable(function)
        else Floats(function, rank)
    )


def compared(name: str, shape: tuple[int, ...], expected: Shape) -> list[str]:
    """Say what is wrong with a shape: a line or none."""
    fits = len(shape) == len(expected) and all(e in (None, s) for s, e in zip(shape, expected, strict=True))
    wanted = str(expected).replace("None", "any")
    return [] if fits else [f"{name}: got shape {shape}, expected {wanted}"]


def refuse_indefinite(name: str, matrix: Any) -> list[str]:
    """Say what keeps a symmetric matrix (n, n) from being a covariance: a line or none, naming eigenvalue and entry."""
    if isinstance(matrix, jax.core.Tracer):  # a system made while jax traces has no numbers yet
        return []
    P = np.asarray(matrix, float)
    if not np.isfinite(P).all():
        i, j = np.argwhere(~np.isfinite(P))[0]
        return [f"{name}: the entry [{i}, {j}] is {P[i, j]}, expected finite numbers"]
    if not np.allclose(P, P.T):
        i, j = np.unravel_index(np.argmax(np.abs(P - P.T)), P.shape)
        return [f"{name}: is not symmetric: the entry [{i}, {j}] is {P[i, j]:g}, [{j}, {i}] is {P[j, i]:g}"]
    values, vectors = np.linalg.eigh(P)
    if values[0] >= -ROUNDING * max(abs(values[0]), abs(values[-1])):
        return []
    i = int(np.argmin(np.diag(P))) if np.diag(P).min() < 0 else int(np.argmax(np.abs(vectors[:, 0])))
    return [
        f"{name}: is not a covariance: it has the eigenvalue {values[0]:.6g} (most of it in the entry [{i}, {i}], "
        f"{P[i, i]:g}); expected none below 0"
    ]


def stacked(y: Any) -> Any:
    """Return an array, also where a system returned a tuple of scalars."""
    return jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
