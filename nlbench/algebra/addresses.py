"""Compact storage of symmetric tensors: the address of a component among the unique ones (Culver 1969, appendix D).

Indices and addresses count from 1, as in the source; the order is lexicographic over non-decreasing indices.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement
from math import comb


def compact_indices(n: int, order: int) -> list[tuple[int, ...]]:
    """Non-decreasing indices of the unique components, in the order of their addresses."""
    return list(combinations_with_replacement(range(1, n + 1), order))


def compact_address(index: Sequence[int], n: int) -> int:
    """Address of a component of a symmetric tensor over n dimensions; the index may come in any order.

    Counts the components before it: with i_1 <= ... <= i_D, all those whose first differing index is smaller. This is
    the sum of f_d of Culver 1969, (D.3)-(D.8), with (D.6) corrected to f_2(k) = (k - 1)(2N - k)/2.
    Raises `IndexError` for an index outside 1 ... n.
    """
    if any(not 1 <= i <= n for i in index):
        raise IndexError(f"index {tuple(index)} outside 1 ... {n}")
    before, lowest = 0, 1
    for position, i in enumerate(sorted(index)):
        left = len(index) - position - 1
        before += sum(comb(n - j + left, left) for j in range(lowest, i))
        lowest = i
    return before + 1
