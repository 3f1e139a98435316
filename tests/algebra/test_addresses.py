"""Claim: compact addresses are those of appendix D (corrected), one to one over the unique components."""

from __future__ import annotations

from itertools import combinations_with_replacement, permutations
from math import comb

import pytest

import nlbench.algebra as algebra
from tests.problems import GOLDEN

CASES = {case["id"]: case for case in GOLDEN["culver.compact_address/1-based"]}


@pytest.mark.parametrize("case_id", CASES)
def test_addresses_equal_the_golden_ones(case_id):
    case = CASES[case_id]
    n, order = case["in"]["N"], case["in"]["D"]
    assert algebra.compact_indices(n, order) == [tuple(index) for index in case["out"]["indices"]]
    addresses = [algebra.compact_address(index, n) for index in case["out"]["indices"]]
    assert addresses == case["out"]["address"]


@pytest.mark.parametrize(("n", "order"), [(1, 4), (2, 5), (5, 2), (5, 4), (8, 4)])
def test_addresses_count_the_unique_components_once_each(n, order):
    indices = list(combinations_with_replacement(range(1, n + 1), order))
    assert [algebra.compact_address(index, n) for index in indices] == list(
        range(1, comb(n + order - 1, order) + 1)
    )


def test_any_order_of_an_index_has_the_same_address():
    assert {algebra.compact_address(index, 4) for index in permutations((1, 3, 4))} == {
        algebra.compact_address((1, 3, 4), 4)
    }


@pytest.mark.parametrize("index", [(0, 1), (1, 5)])
def test_an_index_outside_the_dimensions_is_refused(index):
    with pytest.raises(IndexError):
        algebra.compact_address(index, 4)
