"""Symmetric tensors of traced components, and what the kernels' equations are stated in."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

from benchmarks.kernels.trace import Number

# From nondecreasing indices to components; what is missing is zero.
Tensor = Mapping[Any, Number]
Slope = Mapping[tuple[int, int], Number]


class Expansion(NamedTuple):
    """A drift about the mean: f_i, F_ie, and B_ief, twice the A_ief of the equations, symmetric in e, f.

    Zeros of F and B are left out.
    """

    value: Sequence[Number]
    slope: Slope
    curvature: Mapping[tuple[int, int, int], Number]


class Measured(NamedTuple):
    """A measurement about the mean: residual z (m,), slope H_ra without its zeros, diagonal of R (m,)."""

    residual: Sequence[Number]
    slope: Slope
    variances: Sequence[float]


class Posterior(NamedTuple):
    """Moments after an update; the third ones empty for a filter of second order."""

    mean: Sequence[Number]
    cov: Tensor
    third: Tensor


def unique(n: int, order: int) -> list[tuple[int, ...]]:
    """Indices of the unique components."""
    return list(combinations_with_replacement(range(n), order))


def at(T: Tensor, *index: int) -> Number:
    """A component of a symmetric tensor."""
    return T.get(tuple(sorted(index)), 0.0)


def total(terms: Iterable[Number]) -> Number:
    """Their sum."""
    return sum(terms, start=0.0)


def placements(index: tuple[int, ...], term: Callable[..., Number]) -> Number:
    """The sum of term(i, others) over the places that the index i can come from, equal terms taken once."""
    found = []
    for i in sorted(set(index)):
        others = list(index)
        others.remove(i)
        found.append(float(index.count(i)) * term(i, *others))
    return total(found)
