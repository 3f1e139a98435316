"""Claim: numbers are written with the digits that their standard error allows."""

from __future__ import annotations

import math

import pytest

from nlbench.report import numbers


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (0.241768, 0.004192, "0.2418 ± 0.0042"),
        (-12.3456, 0.23, "−12.35 ± 0.23"),
        (123456.7, 890.0, "123,457 ± 890"),
        (2.5e9, 1.2e7, "(2.500 ± 0.012) × 10⁹"),
        (3.1e-9, 2.2e-10, "(3.10 ± 0.22) × 10⁻⁹"),
        (0.5, 0.0, "0.5"),
        (0.5, math.nan, "0.5"),
        (math.nan, 1.0, "failed"),
        (math.inf, math.nan, "infinite"),
    ],
)
def test_two_digits_of_the_standard_error(value, stderr, text):
    assert numbers.uncertain(value, stderr) == text


@pytest.mark.parametrize(
    ("value", "text"),
    [(6419, "6,419"), (0.00012345, "0.0001234"), (1.5e-7, "1.5 × 10⁻⁷"), (-0.25, "−0.25"), (math.nan, "–")],
)
def test_plain_numbers(value, text):
    assert numbers.plain(value) == text


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (2872300.0, 5, "2.8723 × 10⁶"),
        (-0.2079, 5, "−2.0790 × 10⁻¹"),
        (9.99999, 5, "1.0000 × 10¹"),
        (0.0, 5, "0.0000"),
        (1.25, 2, "1.2"),
        (-3e-310, 2, "−3.0 × 10⁻³¹⁰"),
        (math.nan, 5, "–"),
        (-math.inf, 5, "infinite"),
    ],
)
def test_scientific_numbers(value, digits, text):
    assert numbers.scientific(value, digits) == text


@pytest.mark.parametrize(
    ("fraction", "text"),
    [(0, "0"), (0.0004, "0.040"), (0.051, "5.1"), (0.47, "47"), (0.0999999, "10"), (1.0, "100")],
)
def test_percentages(fraction, text):
    assert numbers.percent(fraction) == text


def test_names_are_listed_as_in_a_sentence():
    assert numbers.listed(["a"]) == "a"
    assert numbers.listed(["a", "b", "c"]) == "a, b and c"
    assert numbers.listed([]) == ""
