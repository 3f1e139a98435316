"""Claim: verdicts follow the rules that stand in `nlbench.reproduce.verdicts`, and say what would change them."""

from __future__ import annotations

import math

import pytest

from nlbench.reproduce.sentences import runs_needed
from nlbench.reproduce.summary import JudgedClaim, Share
from nlbench.reproduce.verdicts import (
    CLAIMS_ONLY,
    DIFFERS,
    INCONCLUSIVE,
    NOT_TESTABLE,
    REPRODUCED,
    judged,
    standing,
    unfinished,
)


def claim(verdict="confirmed", share=0.8, id="C1", whose="source", form="less", estimate=None, n=20_000):
    """A claim about ten runs whose margin is 5 standard errors, or one where it is undecided."""
    shares = () if share is None else (Share(10, 2000, share, share - 0.02, share + 0.02),)
    estimate = (
        {"confirmed": -0.05, "refuted": 0.05, "undecided": -0.01}[verdict] if estimate is None else estimate
    )
    stderr = 0.01
    return JudgedClaim(
        experiment="culver/made-up",
        id=id,
        says="a filter is the best",
        test="rms at t = 1: a < b",
        form=form,
        where="section 7.3",
        whose=whose,
        figures=(),
        verdict=verdict,
        standing=standing(verdict, share),
        estimate=estimate,
        low=estimate - 1.96 * stderr,
        high=estimate + 1.96 * stderr,
        n=n,
        source_runs=10,
        shares=shares,
    )


@pytest.mark.parametrize(
    ("verdict", "share", "expected"),
    [
        ("confirmed", 0.01, "holds"),
        ("confirmed", None, "holds"),
        ("undecided", 0.99, "inconclusive"),
        ("undecided", None, "inconclusive"),
        ("refuted", 0.05, "inconclusive"),
        ("refuted", 0.0499, "differs"),
        ("refuted", None, "differs"),
    ],
)
def test_a_refuted_claim_that_five_percent_of_the_sources_sets_show_is_inconclusive(verdict, share, expected):
    assert standing(verdict, share) == expected


HOLDS, OPEN = claim(), claim("undecided", id="C2")
CHANCE, WRONG = claim("refuted", 0.3, id="C3"), claim("refuted", 0.01, id="C4")


@pytest.mark.parametrize(
    ("claims", "expected"),
    [
        ([HOLDS, HOLDS], CLAIMS_ONLY),
        ([HOLDS, claim(form="printed", share=None)], REPRODUCED),
        ([HOLDS, OPEN], INCONCLUSIVE),
        ([HOLDS, CHANCE], INCONCLUSIVE),
        ([HOLDS, OPEN, CHANCE, WRONG], DIFFERS),
        ([claim(form="printed"), WRONG], DIFFERS),
        ([], NOT_TESTABLE),
    ],
)
def test_the_gravest_claim_decides(claims, expected):
    assert judged(claims).verdict == expected
    assert judged(claims[::-1]).verdict == expected


def test_our_own_claims_do_not_count():
    ours = claim("refuted", 0.0, whose="ours")
    assert judged([HOLDS, ours]).verdict == CLAIMS_ONLY
    assert judged([ours]).verdict == NOT_TESTABLE
    assert judged([claim(whose="ours", form="printed"), HOLDS]).verdict == CLAIMS_ONLY


def test_a_reason_makes_it_not_testable():
    verdict = judged([HOLDS], "a diagram without data")
    assert verdict[:2] == (NOT_TESTABLE, "A diagram without data.")
    assert unfinished(["culver/made-up failed"]).verdict == NOT_TESTABLE


def test_the_sentence_names_the_claim_with_its_numbers():
    because = judged([HOLDS, WRONG]).because
    assert "Claim C4 of culver/made-up" in because
    assert "“a filter is the best”" in because
    assert "it fails by 0.05 [0.0304, 0.0696] over 20,000 runs" in because
    assert "1.0 % of sets of 10 runs" in because
    assert "30 % of sets of 10 runs show it" in judged([HOLDS, CHANCE]).because
    assert "80 % of sets of 10 runs show C1" in judged([HOLDS]).because


def test_of_several_alike_one_is_told_and_the_others_are_counted():
    assert "(1 more claim alike)" in judged([WRONG, WRONG]).because
    assert "(2 more claims alike)" in judged([OPEN] * 3).because


def test_a_margin_that_an_undecided_claim_keeps_is_told_as_such():
    assert "where it is weakest, it holds by 0.01 [-0.0096, 0.0296]" in judged([OPEN]).because
    unknown = claim("undecided", estimate=math.nan)
    assert "cannot be computed" in judged([unknown]).because
    assert "however many runs" in judged([unknown]).change


def test_the_runs_that_would_decide_follow_from_margin_and_interval():
    # 3.84 standard errors are needed; one standard error at 20,000 runs makes 3.84^2 times as many.
    assert runs_needed(-0.01, -0.0296, 0.0096, 20_000) == pytest.approx(20_000 * 3.84**2, rel=1e-3)
    assert runs_needed(0.02, 0.0004, 0.0396, 20_000) == pytest.approx(20_000 * 1.92**2, rel=1e-3)
    assert runs_needed(0.0, -1.0, 1.0, 100) is None
    assert runs_needed(math.nan, math.nan, math.nan, 100) is None
    assert "About 300,000 runs" in judged([OPEN]).change
    assert "would confirm it" in judged([OPEN]).change
    assert "would refute it" in judged([claim("undecided", estimate=0.01)]).change


def test_fewer_than_thirty_runs_ask_for_more():
    assert "fewer than 30 decide nothing" in judged([claim("undecided", n=20)]).change


@pytest.mark.parametrize("claims", [[HOLDS], [OPEN], [CHANCE], [WRONG], [], [claim(share=None)]])
def test_each_verdict_has_two_sentences_that_end(claims):
    verdict = judged(claims)
    assert verdict.because.endswith(".")
    assert verdict.change.endswith(".")
    assert "None" not in verdict.because + verdict.change
    assert "nan" not in verdict.because + verdict.change
