"""Verdicts on claims follow from paired differences, with Holm's correction over the whole experiment."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nlbench.config import Claim
from nlbench.statistics.claims import COLUMNS, evaluate, holm
from nlbench.statistics.uncertainty import p_value


def claim(less, at=(1.0,), statistic="rms", name="C1", **form):
    given = {"less": list(less), **form}
    return Claim(id=name, says="as said", statistic=statistic, at=list(at), **given)


def tables(differences, values=(), runs=100):
    """`differences`: (a, b, time, difference, stderr); `values`: (filter, time, statistic, value, stderr)."""
    paired = pd.DataFrame(
        [(a, b, t, "x", "rms", d, s, runs, p_value(d, s)) for a, b, t, d, s in differences],
        columns=PAIRED,
    )
    rows = [
        ("any", "0.0", "x", "rms", 1.0, 0.1, 100),
        *((f, t, "x", k, v, s, 90) for f, t, k, v, s in values),
    ]
    columns = ["filter", "time", "coordinate", "statistic", "value", "stderr", "n"]
    return {"statistics": pd.DataFrame(rows, columns=columns), "paired": paired}


PAIRED = [
    *("filter_a", "filter_b", "time", "coordinate", "statistic", "difference", "stderr", "n", "p_value"),
]


@pytest.mark.parametrize(
    ("difference", "verdict"),
    [(-0.3, "confirmed"), (0.3, "refuted"), (-0.1, "undecided"), (0.1, "undecided")],
)
def test_the_verdict_is_the_sign_of_a_significant_difference(difference, verdict):
    row = evaluate([claim("ab")], tables([("a", "b", 1.0, difference, 0.1)])).iloc[0]
    assert row["verdict"] == verdict
    assert row["estimate"] == difference
    assert row["low"] == pytest.approx(difference - 0.196, abs=1e-4)
    assert row["high"] == pytest.approx(difference + 0.196, abs=1e-4)
    assert row["n"] == 100


def test_the_order_of_the_pair_in_the_table_does_not_matter():
    row = evaluate([claim("ba")], tables([("a", "b", 1.0, 0.5, 0.1)])).iloc[0]
    assert (row["verdict"], row["estimate"]) == ("confirmed", -0.5)


def test_a_chain_needs_every_neighbour_at_every_time():
    rows = [(a, b, t, -1.0, 0.1) for t in (1.0, 2.0) for a, b in ("ab", "bc")]
    assert evaluate([claim("abc", [1.0, 2.0])], tables(rows)).iloc[0]["verdict"] == "confirmed"
    weak = [*rows[:-1], ("b", "c", 2.0, -0.05, 0.1)]
    row = evaluate([claim("abc", [1.0, 2.0])], tables(weak)).iloc[0]
    assert (row["verdict"], row["estimate"]) == ("undecided", -0.05)
    against = [*rows[:-1], ("b", "c", 2.0, 1.0, 0.1)]
    row = evaluate([claim("abc", [1.0, 2.0])], tables(against)).iloc[0]
    assert (row["verdict"], row["estimate"]) == ("refuted", 1.0)


def test_without_times_a_claim_is_about_all_report_times():
    rows = [("a", "b", 1.0, -1.0, 0.1), ("a", "b", 2.0, 1.0, 0.1)]
    assert evaluate([claim("ab", [])], tables(rows)).iloc[0]["verdict"] == "refuted"


def test_more_claims_ask_for_more_evidence_of_each():
    rows = [("a", "b", 1.0, -0.21, 0.1), ("a", "c", 1.0, -0.01, 0.1)]
    alone = evaluate([claim("ab")], tables(rows)).iloc[0]
    together = evaluate([claim("ab"), claim("ac", name="C2")], tables(rows)).iloc[0]
    assert (alone["verdict"], together["verdict"]) == ("confirmed", "undecided")


def test_holm_equals_a_worked_example():
    """0.05/4 = .0125 and .05/3 = .0167 are met; .05/2 = .025 is not, and what follows is not looked at."""
    assert holm([0.03, 0.005, 0.04, 0.012]) == [False, True, False, True]
    assert holm([]) == []


def test_statistics_without_pairs_are_compared_as_if_independent():
    values = [("a", "1.0", "median_error", 0.5, 0.03), ("b", "1.0", "median_error", 0.7, 0.04)]
    row = evaluate([claim("ab", statistic="median_error")], tables([], values)).iloc[0]
    assert row["verdict"] == "confirmed"
    assert row["estimate"] == pytest.approx(-0.2)
    assert row["high"] == pytest.approx(-0.2 + 1.96 * 0.05, abs=1e-4)
    assert row["n"] == 90


@pytest.mark.parametrize("difference", [np.nan, -np.inf])
def test_nothing_is_confirmed_where_nothing_is_known(difference):
    row = evaluate([claim("ab")], tables([("a", "b", 1.0, difference, np.nan)])).iloc[0]
    assert row["verdict"] == "undecided"
    missing = evaluate([claim("xy")], tables([])).iloc[0]
    assert (missing["verdict"], missing["n"]) == ("undecided", 0)


def test_no_claims_give_no_rows_but_the_columns():
    table = evaluate([], tables([]))
    assert list(table.columns) == list(COLUMNS)
    assert list(table.columns)[:7] == ["id", "says", "verdict", "estimate", "low", "high", "n"]
    assert len(table) == 0


@pytest.mark.parametrize(("runs", "verdict"), [(29, "undecided"), (30, "confirmed")])
def test_a_handful_of_runs_decides_nothing(runs, verdict):
    row = evaluate([claim("ab")], tables([("a", "b", 1.0, -1.0, 1e-6)], runs=runs)).iloc[0]
    assert row["verdict"] == verdict


def test_who_says_it_where_and_of_which_figures_stand_beside_the_verdict():
    named = claim("ab", where="section 7.3, page 7-9", whose="ours", figures=["7.1", "7.2"])
    row = evaluate([named], tables([("a", "b", 1.0, -1.0, 0.1)])).iloc[0]
    assert (row["where"], row["whose"], row["figures"]) == ("section 7.3, page 7-9", "ours", "7.1 7.2")
