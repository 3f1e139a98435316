"""Claims: p-values are those of enumeration and of printed tables; a change as large as the margin is not beyond it."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from nlbench.comparison.significance import (
    Change,
    effective_degrees,
    fisher,
    holm,
    mcnemar,
    satterthwaite,
    standard_error,
)
from nlbench.statistics import claims


@pytest.mark.parametrize(
    ("t", "degrees", "p"),
    # Printed tables of Student's t, two-sided, three decimals.
    [(2.228, 10, 0.05), (3.169, 10, 0.01), (4.604, 4, 0.01), (12.706, 1, 0.05), (2.576, math.inf, 0.01)],
)
def test_without_a_margin_the_test_is_two_sided(t, degrees, p):
    for sign in (-1, 1):
        change = Change(sign * t * 0.3, 0.3, degrees)
        assert change.p_beyond(0.0) == pytest.approx(p, rel=2e-3)
        low, high = change.interval(p)
        assert min(abs(low), abs(high)) == pytest.approx(0, abs=1e-3)


def test_at_the_margin_the_p_value_is_that_of_one_side():
    assert Change(0.02, 0.001, 50).p_beyond(0.02) == pytest.approx(0.5, abs=1e-12)
    assert Change(0.02, 0.001, math.inf).p_beyond(0.01) == pytest.approx(7.62e-24, rel=1e-2)


def test_a_true_change_as_large_as_the_margin_is_found_beyond_it_at_most_as_often_as_stated():
    rng = np.random.default_rng(3)
    estimates = 0.01 + 0.01 * rng.normal(size=20_000)
    found = np.mean([Change(each, 0.01, math.inf).p_beyond(0.01) <= 0.05 for each in estimates])
    # With the margin as large as the standard error: 1 - Phi(1.63 + ...) on the near side and less on the far one.
    assert found <= 0.05 + 4 * math.sqrt(0.05 * 0.95 / 20_000)
    assert found > 0.04


def test_a_change_of_the_detectable_size_is_found_nine_times_in_ten():
    rng = np.random.default_rng(4)
    size = Change(0.0, 0.004, math.inf).detects(0.01, 0.01)
    found = np.mean(
        [Change(each, 0.004, math.inf).p_beyond(0.01) <= 0.01 for each in rng.normal(size, 0.004, 20_000)]
    )
    # `detects` allows for both sides, of which one is out of reach: it is found a little more often.
    assert 0.9 <= found < 0.96


def test_a_change_without_spread_is_certain():
    assert Change(0.02, 0.0, math.inf).p_beyond(0.01) == 0
    assert Change(0.01, 0.0, math.inf).p_beyond(0.02) == 1
    assert Change(0.02, 0.0, math.inf).interval(0.01) == (0.02, 0.02)


@pytest.mark.parametrize("counts", [(0, 0), (0, 1), (0, 8), (3, 9), (12, 12), (40, 21)])
def test_mcnemar_is_the_exact_binomial_test(counts):
    n, least = sum(counts), min(counts)
    tail = sum(math.comb(n, k) for k in range(least + 1))
    assert mcnemar(*counts) == pytest.approx(min(1.0, float(Fraction(2 * tail, 2**n))), rel=1e-9)


@pytest.mark.parametrize("counts", [(0, 10, 0, 10), (0, 12, 5, 9), (3, 20, 11, 22), (50, 400, 81, 390)])
def test_fisher_is_the_sum_over_tables_that_are_no_more_likely(counts):
    a, n_a, b, n_b = counts
    ways = {
        k: math.comb(n_a, k) * math.comb(n_b, a + b - k)
        for k in range(max(0, a + b - n_b), min(a + b, n_a) + 1)
    }
    exact = Fraction(sum(each for each in ways.values() if each <= ways[a]), math.comb(n_a + n_b, a + b))
    assert fisher(*counts) == pytest.approx(float(exact), rel=1e-6)


def test_adjusted_p_values_reject_what_holms_procedure_rejects():
    rng = np.random.default_rng(5)
    for _ in range(200):
        p = (rng.random(rng.integers(1, 30)) ** 6).tolist()
        assert [each <= 0.05 for each in holm(p)] == claims.holm(p, 0.05)
    assert len(holm([])) == 0


def test_a_variance_of_squares_has_a_seventh_of_the_degrees_of_freedom():
    normal = np.random.default_rng(6).normal(size=400_000)
    assert effective_degrees(normal) == pytest.approx(400_000, rel=0.02)
    assert effective_degrees(normal**2) == pytest.approx(400_000 / 7, rel=0.1)
    one_of_many = np.zeros(1000)
    one_of_many[17] = 1
    assert effective_degrees(one_of_many) == pytest.approx(2, rel=0.01)
    assert effective_degrees(np.ones(5)) == math.inf


def test_satterthwaites_degrees_lie_between_the_smaller_and_the_sum():
    assert satterthwaite((1.0, 1.0), (10, 10)) == pytest.approx(20)
    assert satterthwaite((1.0, 1e-9), (10, 500)) == pytest.approx(10)
    assert satterthwaite((0.0, 0.0), (10, 10)) == math.inf


def test_a_standard_error_needs_two_runs():
    assert math.isnan(standard_error(np.ones(1)))
    assert standard_error(np.array([-1.0, 1.0])) == 1.0
