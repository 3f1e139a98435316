"""Taylor coefficients of a function of the state, by jax, as component tensors with their structural zeros."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra.scalarise import scalarise
from nlbench.algebra.scalars import Scalar, is_known
from nlbench.algebra.tensor import Groups, Tensor, sort_within


class Taylor(NamedTuple):
    """y(x + e) = value + first e + second : e e. `second` is half the Hessian, symmetric in its last two indices."""

    value: Tensor
    first: Tensor | None
    second: Tensor | None


def expand(
    function: Callable,
    t: Scalar | Sequence[Scalar],
    x: Sequence[Scalar],
    order: int,
    symmetry: Groups | None = None,
) -> Taylor:
    """Taylor coefficients of `function` at (t, x) up to `order` (0, 1 or 2).

    function: (t, x) -> array, or a tuple of scalars; x an array of shape (n,).
    t: the time, or a vector of whatever else the function depends on. x: the n components of the point.
    symmetry: index symmetry of what the function returns.
    Derivatives are those of jax.jacfwd and jax.hessian, taken direction by direction. Components that depend on
    neither t nor x are Python floats, and zeros are missing.
    """
    n = len(x)
    dtype = jnp.result_type(float, *(component for component in x if not is_known(component)))
    directions = np.eye(n)

    def values(t: Any, x: Any) -> Any:
        y = function(t, x)
        return (
            jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
        )

    def slope(j: int) -> Callable:
        return lambda t, x: jax.jvp(lambda x: values(t, x), (x,), (directions[j].astype(dtype),))[1]

    def curvature(j: int, k: int) -> Callable:
        return lambda t, x: jax.jvp(lambda x: slope(j)(t, x), (x,), (directions[k].astype(dtype),))[1] / 2

    pairs = [(j, k) for j in range(n) for k in range(j, n)] if order > 1 else []
    parts: list[Callable] = [values]
    parts += [slope(j) for j in range(n)] if order > 0 else []
    parts += [curvature(j, k) for j, k in pairs]
    outputs = scalarise(lambda t, x: [part(t, x) for part in parts], t, list(x), dtype=dtype)

    shape = outputs[0][0]
    symmetry = tuple((i,) for i in range(len(shape))) if symmetry is None else symmetry
    value = _tensor(shape, shape, symmetry, {(): outputs[0][1]})
    if order == 0:
        return Taylor(value, None, None)
    last = len(shape)
    slopes = {(j,): outputs[1 + j][1] for j in range(n)}
    first = _tensor(shape, (*shape, n), (*symmetry, (last,)), slopes)
    if order == 1:
        return Taylor(value, first, None)
    halves = {pair: elements for pair, (_, elements) in zip(pairs, outputs[1 + n :], strict=True)}
    return Taylor(value, first, _tensor(shape, (*shape, n, n), (*symmetry, (last, last + 1)), halves))


def _tensor(
    outer: Sequence[int], shape: Sequence[int], symmetry: Groups, parts: dict[tuple[int, ...], list[Scalar]]
) -> Tensor:
    """The tensor whose components, for each setting of the indices after `outer`, are given in C order."""
    entries = {}
    for last, elements in parts.items():
        for index, entry in zip(np.ndindex(*outer), elements, strict=True):
            if sort_within((*index, *last), symmetry) == (*index, *last):
                entries[(*index, *last)] = float(entry) if is_known(entry) else entry
    return Tensor(shape, symmetry, entries)
