"""The verdict on a figure or table, by rules that were fixed before anything was run.

Of the source's claims that name it, a claim

    holds            if it is confirmed,
    is inconclusive  if it is undecided, or refuted although at least 5 % of sets of the source's size show it,
    differs          if it is refuted otherwise.

A figure DIFFERS if one of them differs; else it is INCONCLUSIVE AT THE SOURCE'S N if one is inconclusive; else it is
REPRODUCED if numbers that the source prints were among them, and REPRODUCED (claims only) if not. Without a claim of
the source it is NOT TESTABLE. Claims that are ours count for nothing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from nlbench.reproduce import sentences
from nlbench.reproduce.summary import JudgedClaim

REPRODUCED = "REPRODUCED"
CLAIMS_ONLY = "REPRODUCED (claims only)"
INCONCLUSIVE = "INCONCLUSIVE AT THE SOURCE'S N"
DIFFERS = "DIFFERS"
NOT_TESTABLE = "NOT TESTABLE"
VERDICTS = (REPRODUCED, CLAIMS_ONLY, INCONCLUSIVE, DIFFERS, NOT_TESTABLE)
SEEN = 0.05  # share of the source's sets from which on it may have seen by chance what many runs refute


class Verdict(NamedTuple):
    """The verdict, one sentence why, and one on what would change it."""

    verdict: str
    because: str
    change: str


def standing(verdict: str, share: float | None) -> str:
    """How a claim stands: holds, inconclusive or differs.

    verdict: of its test over all runs. share: of the sets of the source's size that show it, None if unknown.
    """
    if verdict == "confirmed":
        return "holds"
    if verdict == "undecided" or (share is not None and share >= SEEN):
        return "inconclusive"
    return "differs"


def judged(claims: Sequence[JudgedClaim], reason: str = "") -> Verdict:
    """The verdict on what the claims are about. `reason`: why nothing can be tested, if so."""
    own = [claim for claim in claims if claim.whose == "source"]
    if reason or not own:
        return Verdict(NOT_TESTABLE, *sentences.not_testable(reason))
    for found, words, make in (
        ("differs", DIFFERS, sentences.differs),
        ("inconclusive", INCONCLUSIVE, sentences.inconclusive),
    ):
        if of := [claim for claim in own if claim.standing == found]:
            return Verdict(words, *make(of))
    numbers = any(claim.form == "printed" for claim in own)
    return Verdict(REPRODUCED if numbers else CLAIMS_ONLY, *sentences.reproduced(own))


def unfinished(missing: Sequence[str]) -> Verdict:
    """Of an entry whose experiments, named with what became of them, have no results."""
    return Verdict(
        NOT_TESTABLE, f"Not tested: {'; '.join(missing)}.", "The same command, once that is put right."
    )
