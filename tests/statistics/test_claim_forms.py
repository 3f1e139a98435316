"""Claim: every form of a claim is decided by its own margin, with a standard error that is never too small."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from nlbench.config import Claim
from nlbench.statistics.claims import evaluate
from tests.statistics.test_claims import PAIRED

COLUMNS = ["filter", "time", "coordinate", "statistic", "value", "stderr", "n"]


def judged(values, paired=(), n=1000, **claim):
    """The row of one claim; `values` maps (filter, statistic) to value and standard error."""
    coordinate = "all" if claim["statistic"] == "diverged" else "x"
    rows = [("any", "0.0", "x", "rms", 1.0, 0.1, n)]
    rows += [(f, "1.0", coordinate, kind, value, stderr, n) for (f, kind), (value, stderr) in values.items()]
    differences = [(a, b, 1.0, "x", claim["statistic"], d, s, n, 0.0) for a, b, d, s in paired]
    tables = {
        "statistics": pd.DataFrame(rows, columns=COLUMNS),
        "paired": pd.DataFrame(differences, columns=PAIRED),
    }
    return evaluate([Claim(id="C", says="so", at=[1.0], **claim)], tables).iloc[0]


@pytest.mark.parametrize(
    ("difference", "verdict"),
    [(0.001, "confirmed"), (0.05, "refuted"), (-0.05, "refuted"), (0.019, "undecided")],
)
def test_two_filters_are_equal_when_the_whole_interval_lies_within_the_margin(difference, verdict):
    values = {("a", "rms"): (1 + difference, 0.5), ("b", "rms"): (1.0, 0.0)}
    row = judged(values, [("a", "b", difference, 0.005)], statistic="rms", equal=["a", "b"], within=0.02)
    assert row["verdict"] == verdict
    assert row["estimate"] == pytest.approx(abs(difference) - 0.02)


def test_no_difference_seen_is_not_equality():
    values = {("a", "rms"): (1.0, 0.5), ("b", "rms"): (1.0, 0.5)}
    row = judged(values, [("a", "b", 0.0, 0.05)], statistic="rms", equal=["a", "b"], within=0.02)
    assert row["verdict"] == "undecided"


def test_an_ordering_by_a_factor_uses_the_paired_difference_and_the_larger_value():
    """2 a - b = 2 (a - b) + b."""
    values = {("a", "rms"): (1.0, 0.1), ("b", "rms"): (3.0, 0.1)}
    row = judged(values, [("a", "b", -2.0, 0.05)], statistic="rms", less=["a", "b"], factor=2)
    assert row["verdict"] == "confirmed"
    assert row["estimate"] == pytest.approx(-1.0)
    assert row["high"] == pytest.approx(-1.0 + 1.96 * (2 * 0.05 + 0.1), abs=1e-4)
    row = judged(values, [("a", "b", -2.0, 0.05)], statistic="rms", less=["a", "b"], factor=4)
    assert row["verdict"] == "refuted"


@pytest.mark.parametrize(
    ("bounds", "verdict"),
    [
        ({"below": 1.3}, "confirmed"),
        ({"below": 0.7}, "refuted"),
        ({"below": 1.1}, "undecided"),
        ({"above": 0.7}, "confirmed"),
        ({"above": 1.3}, "refuted"),
        ({"above": 0.7, "below": 1.3}, "confirmed"),
        ({"above": 0.7, "below": 1.1}, "undecided"),
    ],
)
def test_bounds_on_one_filter(bounds, verdict):
    assert judged({("a", "rms"): (1.0, 0.1)}, statistic="rms", of=["a"], **bounds)["verdict"] == verdict


@pytest.mark.parametrize(
    ("estimated", "verdict"), [(1.02, "confirmed"), (1.3, "refuted"), (0.6, "refuted"), (1.09, "undecided")]
)
def test_a_filter_that_knows_its_own_variance(estimated, verdict):
    values = {("a", "variance_estimated"): (estimated, 0.001), ("a", "variance_actual"): (1.0, 0.02)}
    row = judged(values, statistic="variance_estimated", of=["a"], agrees_with="variance_actual", within=0.1)
    assert row["verdict"] == verdict
    assert row["high"] - row["estimate"] == pytest.approx(1.96 * (0.001 + 1.1 * 0.02), rel=1e-4)


@pytest.mark.parametrize(("factor", "verdict"), [(None, "confirmed"), (3, "confirmed"), (9, "refuted")])
def test_a_filter_that_states_many_times_too_small_a_variance(factor, verdict):
    values = {("a", "variance_estimated"): (0.2, 0.001), ("a", "variance_actual"): (1.0, 0.02)}
    given = {"factor": factor} if factor else {}
    row = judged(values, statistic="variance_estimated", of=["a"], less_than="variance_actual", **given)
    assert row["verdict"] == verdict


def test_which_of_two_filters_knows_its_variance_better():
    """a is 5 % too large, b 40 % too small."""
    values = {
        ("a", "variance_estimated"): (1.05, 0.001),
        ("a", "variance_actual"): (1.0, 0.02),
        ("b", "variance_estimated"): (1.2, 0.001),
        ("b", "variance_actual"): (2.0, 0.02),
    }
    form = {"statistic": "variance_estimated", "agrees_with": "variance_actual"}
    row = judged(values, less=["a", "b"], **form)
    assert (row["verdict"], row["estimate"]) == ("confirmed", pytest.approx(0.05 - 0.4))
    assert judged(values, less=["b", "a"], **form)["verdict"] == "refuted"
    row = judged(values, less=["a", "b"], factor=2, **form)
    assert (row["verdict"], row["estimate"]) == ("confirmed", pytest.approx(0.1 - 0.4))
    assert judged(values, less=["b", "a"], factor=2, **form)["verdict"] == "refuted"


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_a_bound_on_divergence_is_not_confirmed_by_too_few_runs_without_any(lost):
    """The exact binomial test decides about the same, also where nothing has diverged and the spread is zero."""
    for n in (100, 300, 1000, 3000):
        row = judged({("a", "diverged"): (lost / n, 0.0)}, n=n, statistic="diverged", of=["a"], below=0.01)
        exact = stats.binomtest(lost, n, 0.01).pvalue
        if row["verdict"] == "confirmed":
            assert exact < 0.1
        if exact < 0.005 and lost / n < 0.01:
            assert row["verdict"] == "confirmed"


def test_two_filters_that_never_diverge_are_not_ordered_by_it():
    values = {("a", "diverged"): (0.0, 0.0), ("b", "diverged"): (0.0, 0.0)}
    assert judged(values, statistic="diverged", less=["a", "b"])["verdict"] == "undecided"


def test_fractions_that_diverge_are_compared_by_the_limits_that_face_each_other():
    """Newcombe's (1998) tenth method, of 56/70 - 48/80: .0524 to .3339."""
    values = {("a", "diverged"): (48 / 80, 0.0), ("b", "diverged"): (56 / 70, 0.0)}
    rows = [("any", "0.0", "x", "rms", 1.0, 0.1, 80)]
    rows += [
        ("a", "1.0", "all", "diverged", 48 / 80, 0.0, 80),
        ("b", "1.0", "all", "diverged", 56 / 70, 0.0, 70),
    ]
    tables = {"statistics": pd.DataFrame(rows, columns=COLUMNS), "paired": pd.DataFrame(columns=PAIRED)}
    claim = Claim(id="C", says="so", at=[1.0], statistic="diverged", less=["a", "b"])
    row = evaluate([claim], tables).iloc[0]
    assert len(values) == 2
    assert row["verdict"] == "confirmed"
    assert row["high"] == pytest.approx(-0.0524, abs=1e-4)


@pytest.mark.parametrize("missing", [math.nan, None])
def test_what_is_not_known_decides_nothing(missing):
    values = {} if missing is None else {("a", "variance_estimated"): (np.nan, np.nan)}
    for form in ({"of": ["a"], "below": 1.0}, {"of": ["a"], "less_than": "variance_actual"}):
        assert judged(values, statistic="variance_estimated", **form)["verdict"] == "undecided"
