"""Claims: runs without a difference are seldom told apart, whatever their tails; a difference of 3 % is found.

A false alarm is any comparison of two runs that is not `~` or `=`: worse, better or slight. 200 pairs of runs each, three
filters at two times. Level 1 %: at most 2 % may give an alarm (at a true 1 %, five or more of 200 are as likely as 5 %).
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from nlbench.comparison.compare import Asked, compared_sides
from tests.comparison import made

PAIRS = 200
QUIET = {"~", "="}


def alarms(pairs, margin):
    """In how many of the pairs there is an alarm; and the verdicts."""
    count, verdicts = 0, Counter()
    for a, b in pairs:
        words = set(compared_sides(a, b, Asked(margin, 0.01)).table["verdict"])
        count += bool(words - QUIET)
        verdicts.update(words)
    return count, verdicts


def apart(draw, runs, scale=1.0):
    """Pairs of runs with seeds of their own."""
    for pair in range(PAIRS):
        first, second = (made.errors(2 * pair + i, runs, draw=draw) for i in (1, 2))
        yield made.side(first, 2 * pair + 1), made.side(scale * second, 2 * pair + 2)


def together(draw, runs, scale=1.0, own=0.02):
    """Pairs of runs with one seed. A null change is one of numbers, not of their distribution: a small part of each
    error is drawn anew on both sides, as by a filter with random numbers of its own."""
    for pair in range(PAIRS):
        common = made.errors(3 * pair + 1, runs, draw=draw)
        first, second = (
            np.sqrt(1 - own) * common + np.sqrt(own) * made.errors(3 * pair + i, runs, draw=draw, share=0)
            for i in (2, 3)
        )
        yield made.side(first, 7), made.side(scale * second, 7)


@pytest.mark.parametrize("margin", [0.0, 0.01])
@pytest.mark.parametrize("draw", ["normal", "t3", "mixture"])
@pytest.mark.parametrize("pairs", [apart, together])
def test_runs_without_a_difference_are_seldom_told_apart(pairs, draw, margin):
    count, verdicts = alarms(pairs(draw, 200), margin)
    assert count <= 0.02 * PAIRS, verdicts
    assert "=" in verdicts  # the fractions of diverged runs; all else was tested
    assert "~" in verdicts


@pytest.mark.parametrize("pairs", [apart, together])
def test_a_test_that_ignores_its_uncertainty_would_be_noticed(pairs, monkeypatch):
    """The counterpart: half the standard error gives alarms that the test above would not let pass."""
    from nlbench.comparison import change

    true = change.standard_error
    monkeypatch.setattr(change, "standard_error", lambda influence: true(influence) / 2)
    from nlbench.comparison import side

    monkeypatch.setattr(side, "standard_error", lambda influence: true(influence) / 2)
    count, _ = alarms(pairs("normal", 200), 0.0)
    assert count > 0.1 * PAIRS


def test_a_change_of_three_percent_is_found_on_the_same_runs():
    """Of 1,000 runs, two hundredths of whose variance are their own: a standard error of .6 %."""
    found = [
        len(compared_sides(a, b, Asked(0.01, 0.01)).failing())
        for a, b in together("normal", 1000, scale=1.03)
    ]
    assert np.mean([each > 0 for each in found]) >= 0.9


def test_a_change_of_three_percent_is_found_among_enough_independent_runs():
    """Of 100,000 runs: a standard error of .32 %, and 2 % beyond the margin."""
    found = []
    for pair in range(10):
        a = made.side(made.errors(2 * pair, 100_000, filters=1), 1, kept=20_000)
        b = made.side(1.03 * made.errors(2 * pair + 1, 100_000, filters=1), 2, kept=20_000)
        table = compared_sides(a, b, Asked(0.01, 0.01)).table
        found += (table.loc[table["statistic"] == "rms", "verdict"] == "worse").tolist()
    assert np.mean(found) >= 0.9


def test_runs_that_diverge_at_one_rate_are_seldom_told_apart():
    """Clipped errors of heavy tails, and a hundredth of the runs lost, more in some filters."""
    count = 0
    for pair in range(PAIRS):
        sides = []
        for i in (1, 2):
            error = made.errors(2 * pair + i, 300, draw="t3")
            lost = (
                np.random.default_rng(9 * pair + i).random(error.shape)
                < np.array([0.01, 0.03, 0.1])[:, None, None]
            )
            sides.append(made.side(error, 2 * pair + i, lost))
        table = compared_sides(*sides, Asked(0.0, 0.01)).table
        assert "rms_clipped" in set(table["statistic"])
        count += bool(set(table["verdict"]) - QUIET)
    assert count <= 0.02 * PAIRS


def test_a_filter_that_diverges_more_often_is_found():
    error = made.errors(1, 1000)
    none, some = np.zeros(error.shape, bool), np.zeros(error.shape, bool)
    some[1, 1, :20] = True
    for seed in (1, 2):  # on the same runs, and as independent
        table = compared_sides(
            made.side(error, 1, none), made.side(error, seed, some), Asked(0.01, 0.01)
        ).table
        row = table[(table["filter"] == "f2") & (table["statistic"] == "diverged")].iloc[0]
        assert (row["a"], row["b"], row["verdict"]) == (0.0, 0.02, "worse")
