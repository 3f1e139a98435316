"""Claims: runs without a difference are seldom told apart, whatever their tails; a difference of 3 % is found.

A false alarm is any comparison of two runs that is neither `~` nor `=`: worse, better or slight, at level 1 % for all
comparisons of a pair together. Each run has three filters at two times.
"""

from __future__ import annotations

from collections import Counter
from itertools import islice

import numpy as np
import pytest

from nlbench.comparison import change, side
from nlbench.comparison.compared import Asked, compared_sides
from tests.comparison import made

QUIET = {"~", "="}
DRAWS = ("normal", "t3", "mixture")


def alarms(pairs, margin):
    """In how many pairs there is an alarm; and all their verdicts."""
    count, verdicts = 0, Counter()
    for a, b in pairs:
        words = set(compared_sides(a, b, Asked(margin, 0.01)).table["verdict"])
        count += bool(words - QUIET)
        verdicts.update(words)
    return count, verdicts


def apart(draw, runs, scale=1.0):
    """Pairs of runs with seeds of their own."""
    for pair in range(10**6):
        first, second = (made.errors(2 * pair + i, runs, draw=draw) for i in (1, 2))
        yield made.side(first, 2 * pair + 1), made.side(scale * second, 2 * pair + 2)


def together(draw, runs, scale=1.0, own=0.02):
    """Pairs of runs with one seed. A null change is one of numbers, not of their distribution: a small part of each
    error is drawn anew on both sides, as by a filter with random numbers of its own."""
    for pair in range(10**6):
        common = made.errors(3 * pair + 1, runs, draw=draw)
        first, second = (
            np.sqrt(1 - own) * common + np.sqrt(own) * made.errors(3 * pair + i, runs, draw=draw, share=0)
            for i in (2, 3)
        )
        yield made.side(first, 7), made.side(scale * second, 7)


def mixed(kind, count):
    """Pairs of all kinds of tails."""
    return (pair for draw in DRAWS for pair in islice(kind(draw, 200), count))


@pytest.mark.parametrize("kind", [apart, together])
def test_runs_without_a_difference_are_seldom_told_apart(kind):
    """Of 60 pairs; at a true 1 %, four or more of them are as likely as .3 %."""
    count, verdicts = alarms(mixed(kind, 20), 0.0)
    assert count <= 3, verdicts
    assert verdicts["~"] == 60


@pytest.mark.long
@pytest.mark.parametrize("draw", DRAWS)
@pytest.mark.parametrize("kind", [apart, together])
def test_false_alarms_are_as_rare_as_stated(kind, draw, record_property):
    """At most 2 % of 1,000 pairs; at a true 1 %, more than that are as likely as .2 %."""
    pairs = list(islice(kind(draw, 200), 1000))
    for margin in (0.0, 0.01):
        count, verdicts = alarms(pairs, margin)
        record_property(f"margin {margin}", f"{count} of 1,000 pairs")
        assert count <= 20, (margin, verdicts)
        assert verdicts["~"] == 1000


@pytest.mark.parametrize("kind", [apart, together])
def test_standard_errors_that_are_too_small_would_be_noticed(kind, monkeypatch):
    """With half of them, the test above would see more alarms than it lets pass."""
    true = change.standard_error
    for module in (change, side):
        monkeypatch.setattr(module, "standard_error", lambda influence: true(influence) / 2)
    count, _ = alarms(mixed(kind, 5), 0.0)
    assert count > 3


def test_a_change_of_three_percent_is_found_on_the_same_runs():
    """Of 1,000 runs, two hundredths of whose variance are their own: a standard error of .6 %."""
    pairs = islice(together("normal", 1000, scale=1.03), 20)
    found = [len(compared_sides(a, b, Asked(0.01, 0.01)).failing()) for a, b in pairs]
    assert np.mean([each > 0 for each in found]) >= 0.9


def test_a_change_of_three_percent_is_found_among_enough_independent_runs():
    """Of 100,000 runs: a standard error of .32 %, and 2 % beyond the margin."""
    found = []
    for pair in range(4):
        a = made.side(made.errors(2 * pair, 100_000, filters=1), 1, kept=20_000)
        b = made.side(1.03 * made.errors(2 * pair + 1, 100_000, filters=1), 2, kept=20_000)
        table = compared_sides(a, b, Asked(0.01, 0.01)).table
        found += (table.loc[table["statistic"] == "rms", "verdict"] == "worse").tolist()
    assert np.mean(found) >= 0.7
    assert "few" not in set(table["verdict"])


def test_runs_that_diverge_at_one_rate_are_seldom_told_apart():
    """Clipped errors of heavy tails, and a hundredth of the runs lost, more in some filters."""
    count = 0
    for pair in range(40):
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
    assert count <= 2


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
