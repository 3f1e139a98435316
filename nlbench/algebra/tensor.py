"""A tensor as a dictionary of its unique components; a missing component is a structural zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra.scalars import Scalar, add, is_known, multiply

Index = tuple[int, ...]
Groups = tuple[tuple[int, ...], ...]


@jax.tree_util.register_pytree_node_class
class Tensor:
    """Unique components of a tensor over index -> scalar.

    shape: extent of each index.
    symmetry: groups of positions whose exchange changes nothing, such as ((0,), (1, 2)) for A_ief = A_ife.
    entries: component by index, sorted within each group; a Python number is known at trace time, any other value
        is a 0-d array. As a pytree the components are the leaves.
    """

    __slots__ = ("entries", "shape", "symmetry")

    def __init__(self, shape: Sequence[int], symmetry: Groups, entries: Mapping[Index, Scalar]):
        self.shape = tuple(shape)
        self.symmetry = symmetry
        self.entries = {index: entries[index] for index in sorted(entries) if not _is_zero(entries[index])}

    @classmethod
    def symmetric(cls, n: int, order: int, component: Callable[[Index], Scalar]) -> Tensor:
        """The fully symmetric tensor with the given unique components."""
        symmetry = (tuple(range(order)),) if order else ()
        shape = (n,) * order
        return cls(shape, symmetry, {index: component(index) for index in canonical_indices(shape, symmetry)})

    @classmethod
    def from_array(cls, array: Any, symmetry: Groups | None = None) -> Tensor:
        """Components of an array; a NumPy array is known at trace time, and its zeros become structural.

        symmetry: as for the constructor; None means that no two indices may be exchanged.
        """
        shape = tuple(np.shape(array))
        if symmetry is None:
            symmetry = tuple((position,) for position in range(len(shape)))
        known = isinstance(array, np.ndarray)
        return cls(
            shape,
            symmetry,
            {i: float(array[i]) if known else array[i] for i in canonical_indices(shape, symmetry)},
        )

    def canonical(self, index: Index) -> Index:
        """The representative of an index: sorted within each group."""
        return sort_within(index, self.symmetry)

    def __getitem__(self, index: Index | int) -> Scalar:
        """The component, 0.0 where it is a structural zero."""
        index = (index,) if isinstance(index, int) else index
        return self.entries.get(self.canonical(index), 0.0)

    def __iter__(self) -> Iterator[Scalar]:
        """Unique components in order, structural zeros included."""
        return (self[index] for index in canonical_indices(self.shape, self.symmetry))

    def __add__(self, other: Tensor) -> Tensor:
        if other.shape != self.shape:
            raise ValueError(f"tensors of shapes {self.shape} and {other.shape} cannot be added")
        symmetry = _common(self.symmetry, other.symmetry)
        return Tensor(
            self.shape,
            symmetry,
            {index: add(self[index], other[index]) for index in canonical_indices(self.shape, symmetry)},
        )

    def __neg__(self) -> Tensor:
        return self * -1.0

    def __sub__(self, other: Tensor) -> Tensor:
        return self + (-other)

    def __mul__(self, factor: Scalar) -> Tensor:
        return self.map(lambda entry: multiply(factor, entry))

    __rmul__ = __mul__

    def map(self, function: Callable[[Scalar], Scalar]) -> Tensor:
        """`function` of each component that is not a structural zero."""
        return Tensor(
            self.shape, self.symmetry, {index: function(entry) for index, entry in self.entries.items()}
        )

    def dense(self) -> Tensor:
        """The same tensor with every unique component an array of floats, as loops need that carry it."""
        filled = object.__new__(Tensor)
        filled.shape, filled.symmetry = self.shape, self.symmetry
        filled.entries = {
            i: jnp.asarray(self[i], float) for i in canonical_indices(self.shape, self.symmetry)
        }
        return filled

    def to_array(self) -> jax.Array:
        """All components as one array of `shape`."""
        parts = [jnp.asarray(self[index]) for index in product(*map(range, self.shape))]
        return jnp.stack(jnp.broadcast_arrays(*parts)).reshape(self.shape)

    def tree_flatten(self) -> tuple[list[Scalar], Any]:
        """Components as leaves, the rest as structure."""
        return list(self.entries.values()), (self.shape, self.symmetry, tuple(self.entries))

    @classmethod
    def tree_unflatten(cls, structure: Any, leaves: Sequence[Scalar]) -> Tensor:
        """Inverse of `tree_flatten`."""
        tensor = object.__new__(cls)
        tensor.shape, tensor.symmetry, indices = structure
        tensor.entries = dict(zip(indices, leaves, strict=True))
        return tensor

    def __repr__(self) -> str:
        return f"Tensor(shape={self.shape}, symmetry={self.symmetry}, entries={self.entries})"


def identity(n: int) -> Tensor:
    """The unit matrix."""
    return Tensor((n, n), ((0, 1),), {(i, i): 1.0 for i in range(n)})


def zeros(n: int, order: int) -> Tensor:
    """The symmetric tensor all of whose components are structural zeros."""
    return Tensor((n,) * order, (tuple(range(order)),), {})


def sort_within(index: tuple, symmetry: Groups) -> tuple:
    """The index (of numbers, or of letters) with its values sorted within each group of positions."""
    result = list(index)
    for group in symmetry:
        for position, value in zip(group, sorted(index[p] for p in group), strict=True):
            result[position] = value
    return tuple(result)


def canonical_indices(shape: Sequence[int], symmetry: Groups) -> list[Index]:
    """Indices of the unique components in lexicographic order."""
    return [index for index in product(*map(range, shape)) if sort_within(index, symmetry) == index]


def _common(a: Groups, b: Groups) -> Groups:
    """The symmetry that a sum has: positions grouped in both."""
    groups: dict[tuple[int, int], list[int]] = {}
    for position in range(sum(map(len, a))):
        key = (_group_of(position, a), _group_of(position, b))
        groups.setdefault(key, []).append(position)
    return tuple(tuple(group) for group in groups.values())


def _group_of(position: int, symmetry: Groups) -> int:
    return next(number for number, group in enumerate(symmetry) if position in group)


def _is_zero(value: Scalar) -> bool:
    return is_known(value) and value == 0
