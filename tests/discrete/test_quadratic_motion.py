"""Claim: where a state is squared, each filter's mean and variance are those that its equations give by hand.

x+ = x^2 + w with x ~ N(m, P) and w ~ N(0, Q): E x+ = m^2 + P and var x+ = 4 m^2 P + 2 P^2 + Q exactly. A row says what
a filter makes of it. This is where a new filter gets its row.
"""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb
from nlbench.discrete.catalogue import ROWS

M, P, Q = 1.5, 0.2, 0.05
EXACT = (M**2 + P, 4 * M**2 * P + 2 * P**2 + Q)
TANGENT = (M**2, 4 * M**2 * P + Q)
EXPECTED = {
    "ekf": TANGENT,
    "linearised-kalman": TANGENT,
    "iekf": TANGENT,
    "sof": (EXACT[0], TANGENT[1]),
    "sof-gaussian": EXACT,
    "truncated": (EXACT[0], TANGENT[1]),
    "truncated-jazwinski": (
        EXACT[0],
        TANGENT[1] - P**2,
    ),  # the square of what the second order adds to the mean
    "modified-jazwinski": (EXACT[0], TANGENT[1] - P**2),
    "statistical-linearisation": (EXACT[0], TANGENT[1]),  # 2 m is the slope of the best line, too
    "ukf": EXACT,
    "ckf": (EXACT[0], TANGENT[1]),  # both points are as far from the mean, so they differ in x alone
    "ghkf": EXACT,
    "gaussian-sum": (M**2 + P / 2, 4 * M**2 * P + 1.5 * P**2 + Q),  # three tangents, half of P between them
}
OTHERS = {"kalman", "ensemble", "bootstrap"}  # refuses what is not linear; draw samples


@pytest.mark.parametrize("name", EXPECTED)
def test_mean_and_variance_of_a_squared_state_are_those_by_hand(name):
    system = nb.DiscreteSystem(
        lambda k, x, w: x**2 + w, lambda k, x, v: x + v, [[Q]], [[1.0]], nb.Moments([M], [[P]])
    )
    f = nb.filters.build(name, system)
    mean, cov, *_ = f.moments(f.predict(f.init(system.initial), 0, 1))
    np.testing.assert_allclose([mean[0], cov[0, 0]], EXPECTED[name], rtol=1e-12)


def test_every_filter_for_discrete_time_has_a_row():
    assert set(EXPECTED) | OTHERS == set(ROWS)
