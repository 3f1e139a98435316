"""Claim: the winner is named in plain words, and only significant differences are called differences."""

from __future__ import annotations

import pytest

from nlbench.figures import data
from nlbench.report import winners
from tests import synthetic_run


def answers(tmp_path, factors=synthetic_run.FACTORS, **options):
    read = data.read(synthetic_run.results(tmp_path, factors, **options))
    found = winners.winners(read, "rms")
    return found, [winners.sentences(winner, read) for winner in found]


def test_significant_and_insignificant_differences_are_told_apart(tmp_path):
    found, words = answers(tmp_path)
    assert [winner.time for winner in found] == [1.0, 2.0]
    assert found[0].beaten == ("linearised-kalman", "second-order")
    assert found[0].level == ("third-order",)
    assert "third-order-guarded has the smallest RMS error of x: 0.1797 ± 0.0011." in words[0]
    assert "significantly less than linearised-kalman and second-order." in words[0]
    assert "It cannot be told apart from third-order." in words[0]


def test_the_reference_wins_nothing_but_shows_what_is_left(tmp_path):
    found, words = answers(tmp_path)
    assert {winner.best for winner in found} == {"third-order-guarded"}
    assert found[0].gap == pytest.approx(0.1)
    assert words[0].endswith("The exact reference is still 10\u00a0% better.")


def test_a_gap_to_the_reference_that_may_be_chance_is_called_so(tmp_path):
    words = answers(tmp_path, {"second-order": 1.0, "exact": 0.9999})[1]
    assert words[0].endswith("better, which is not significant.")


def test_many_comparisons_need_more_evidence(tmp_path):
    """A difference of 2.5 standard errors is significant alone, not among dozens."""
    paired = synthetic_run.paired({"a": 1.0, "b": 1.1}, {"x": ""}, 20_000).assign(p_value=0.0124)
    few = answers(tmp_path / "few", {"a": 1.0, "b": 1.1}, tables={"paired": paired[paired["time"] == 1.0]})[0]
    assert few[0].beaten == ("b",)
    many = {"a": 1.0, "b": 1.1, **{f"c{index}": 1.2 for index in range(6)}}
    table = synthetic_run.paired(many, {"x": ""}, 20_000).assign(p_value=0.0124)
    assert answers(tmp_path / "many", many, tables={"paired": table})[0][0].beaten == ()


def test_a_filter_without_numbers_is_named_as_failed(tmp_path):
    found, words = answers(tmp_path, {"a": 1.0, "b": float("nan")})
    assert found[0].failed == ("b",)
    assert "b gave no usable estimate." in words[0]
