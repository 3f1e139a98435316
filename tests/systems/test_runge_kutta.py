"""Claim: a Runge-Kutta step is exact through fourth order in its length."""

from __future__ import annotations

import numpy as np

from nlbench.systems.runge_kutta import step


def test_the_error_of_a_step_is_of_fifth_order():
    """A nonlinear pair with the closed form (cos t, sin t) exp(-t): half the step, a thirty-second of the error."""

    def rate(x):
        r = np.hypot(*x)
        return -r * (x / r) + r * np.array([-x[1], x[0]]) / r

    def error(h):
        return np.abs(
            step(rate, np.array([1.0, 0.0]), h) - np.exp(-h) * np.array([np.cos(h), np.sin(h)])
        ).max()

    assert 28 < error(0.1) / error(0.05) < 36
