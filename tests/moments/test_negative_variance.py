"""Claim: between measurements a third-order filter brings a negative variance back towards zero, and beyond it where
its third moment is large enough; one of second order only lets it decay (Culver 1969, section 6.4)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb

nb.configure()
A = 0.7  # of dx/dt = -2 x + .7 x^2


def rates(t, moments):
    """(7.5) without measurements."""
    m, variance, third = moments
    slope = -2 + 2 * A * m
    return (
        -2 * m + A * m**2 + A * variance,
        2 * (slope * variance + A * third),
        3 * (slope * third + 2 * A * variance**2),
    )


def foretold(name, start, end):
    """Moments that a filter predicts from `start` at 0, at `end`."""
    system = nb.systems.build("culver-scalar")
    f = nb.filters.build(name, system, step=0.01)
    m, variance, third = start
    state = f.init(nb.Moments([m], [[variance]], [[[third]]]))
    found = f.moments(f.predict(state, 0.0, end))
    return np.array([found.mean[0], found.cov[0, 0], 0.0 if found.third is None else found.third[0, 0, 0]])


@pytest.mark.parametrize(
    ("start", "restored"),
    [((1.0, -0.5, 1.0), True), ((0.9, -0.015, 0.15), True), ((0.6, -0.13, 0.05), False)],
)
def test_a_negative_variance_comes_back_and_turns_positive_if_the_third_moment_is_large(start, restored):
    end = 0.4
    expected = solve_ivp(rates, (0, end), start, rtol=1e-10, atol=1e-12).y[:, -1]
    found = foretold("third-order", start, end)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-8)
    assert found[1] > start[1]
    assert (found[1] > 0) == restored


def test_at_second_order_it_decays_and_stays_negative():
    """With dV/dt = 2 (-2 + 1.4 m) V and no third moment, no path crosses zero."""
    start = (1.0, -0.5, 0.0)
    path = solve_ivp(
        lambda t, y: (-2 * y[0] + A * y[0] ** 2 + A * y[1], 2 * (-2 + 2 * A * y[0]) * y[1]),
        (0, 2.0),
        start[:2],
        rtol=1e-10,
        atol=1e-12,
    )
    found = foretold("second-order", start, 2.0)
    np.testing.assert_allclose(found[:2], path.y[:, -1], rtol=1e-5, atol=1e-9)
    assert start[1] < found[1] < 0
