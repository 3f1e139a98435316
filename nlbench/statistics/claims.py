"""Verdicts on what an experiment claims, and how often a test of the source's size would show it.

A claim is taken apart into comparisons (`statistics.comparisons`). All comparisons of the experiment share
Holm's (1979) correction at level 5 %, two-sided. A claim is confirmed when all its comparisons are significant in
the claimed direction, refuted when one is significant in the other, and undecided otherwise; fewer than 30 runs
decide nothing. Numbers that a source prints (`statistics.printed`) are refuted when one differs significantly and
confirmed when none does. The estimate shown is the margin of the comparison that supports the claim least, with its
own 95 % interval; it is negative where the claim holds, or printed minus measured.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import pandas as pd

from nlbench.statistics.claim import Claim
from nlbench.statistics.comparisons import Comparison, Tables, terms
from nlbench.statistics.printed import against_moments
from nlbench.statistics.sets import KeptTable, sets_table
from nlbench.statistics.uncertainty import NORMAL_975, p_value

LEVEL = 0.05
LEAST_RUNS = 30  # fewer do not make a mean normal enough for a verdict
COLUMNS = ("id", "says", "verdict", "estimate", "low", "high", "n", "where", "whose", "figures")


class _Tested(NamedTuple):
    """A comparison and its two-sided p-value, 1 where nothing can be said."""

    comparison: Comparison
    p: float

    @property
    def against(self) -> float:
        """How far it speaks against the claim, in standard errors."""
        margin, stderr, _ = self.comparison
        if math.isnan(margin) or math.isnan(stderr):
            return math.inf
        return margin / stderr if stderr else math.copysign(math.inf, margin)


def judged(
    claims: Iterable[Claim], tables: Mapping[str, pd.DataFrame], kept: KeptTable, source_runs: int | None
) -> dict[str, pd.DataFrame]:
    """The tables `claims` and `sets`, from the tables statistics, paired and moments and the kept runs."""
    claims = list(claims)
    return {
        "claims": evaluate(claims, tables, kept, source_runs),
        "sets": sets_table([claim for claim in claims if claim.form != "printed"], kept, source_runs),
    }


def evaluate(
    claims: Iterable[Claim],
    tables: Mapping[str, pd.DataFrame],
    kept: KeptTable | None = None,
    source_runs: int | None = None,
) -> pd.DataFrame:
    """`id, says, verdict, estimate, low, high, n` of each claim, then where, whose and figures as in the file."""
    claims = list(claims)
    lookup = Tables(tables["statistics"], tables["paired"])
    tested = [
        [_Tested(*each) for each in against_moments(claim, tables["moments"], kept, source_runs)]
        if claim.form == "printed" and kept is not None
        else [_tested(lookup.compare(term)) for term in terms(claim, lookup.first_coordinate, lookup.times)]
        for claim in claims
    ]
    significant = iter(holm([each.p for comparisons in tested for each in comparisons]))
    rows = []
    for claim, comparisons in zip(claims, tested, strict=True):
        signs = [
            math.copysign(1, each.comparison.margin) if next(significant) else 0.0 for each in comparisons
        ]
        verdict = _agreement(comparisons, signs) if claim.form == "printed" else _verdict(signs)
        worst = max(comparisons, key=lambda each: _weakness(claim, each), default=_UNKNOWN).comparison
        reach = NORMAL_975 * worst.stderr
        estimate = worst.margin, worst.margin - reach, worst.margin + reach, worst.n
        figures = " ".join(claim.figures or ())
        rows.append((claim.id, claim.says, verdict, *estimate, claim.where or "", claim.whose, figures))
    return pd.DataFrame(rows, columns=COLUMNS)


def holm(p_values: list[float], level: float = LEVEL) -> list[bool]:
    """Which hypotheses are rejected when all are tested together."""
    rejected = [False] * len(p_values)
    for rank, index in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        if p_values[index] > level / (len(p_values) - rank):
            break
        rejected[index] = True
    return rejected


_UNKNOWN = _Tested(Comparison(math.nan, math.nan, 0), 1.0)


def _tested(comparison: Comparison) -> _Tested:
    p = p_value(comparison.margin, comparison.stderr)
    return _Tested(comparison, 1.0 if math.isnan(p) or comparison.n < LEAST_RUNS else p)


def _verdict(signs: list[float]) -> str:
    if 1 in signs:
        return "refuted"
    return "confirmed" if signs and set(signs) == {-1} else "undecided"


def _agreement(comparisons: list[_Tested], signs: list[float]) -> str:
    """Of printed numbers; undecided where one has nothing to be compared with."""
    if any(signs):
        return "refuted"
    known = comparisons and not any(math.isnan(each.comparison.stderr) for each in comparisons)
    return "confirmed" if known else "undecided"


def _weakness(claim: Claim, tested: _Tested) -> float:
    return -tested.p if claim.form == "printed" else tested.against
