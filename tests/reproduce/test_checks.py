"""Claim: tables 5.1 and 6.1 are checked by calculation, and a wrong equation or number would be noticed."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.reproduce import checks, posterior
from nlbench.reproduce.verdicts import DIFFERS, REPRODUCED
from tests.oracle import bayes


def test_both_tables_hold():
    assert checks.moment_storage().verdict == REPRODUCED
    assert checks.updating_equations().verdict == REPRODUCED


@pytest.mark.parametrize(("n", "r"), [(1, 1), (2, 1)])
def test_the_quadrature_is_that_of_the_oracle(n, r):
    case = posterior.example(n, r, 7)
    exact = bayes(np.zeros(n), case.P, case.third, None, lambda x: case.H @ x, case.noise, case.z)
    for mine, theirs in zip(
        posterior._by_quadrature(case), (exact.mean, exact.cov, exact.third), strict=True
    ):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-11)


def test_a_wrong_update_is_noticed(monkeypatch):
    sound = posterior._by_the_filter

    def wrong(case):
        mean, cov, third = sound(case)
        return mean, cov * (1 + 1e-7), third

    monkeypatch.setattr(posterior, "_by_the_filter", wrong)
    assert checks.updating_equations().verdict == DIFFERS


def test_a_wrong_count_is_noticed(monkeypatch):
    monkeypatch.setitem(checks.PRINTED_STORAGE, "unique", (20, 55, 126))
    assert checks.moment_storage().verdict == DIFFERS
