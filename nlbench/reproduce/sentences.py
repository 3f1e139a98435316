"""One sentence on why a verdict is what it is, and one on what would change it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from nlbench.statistics.claims import LEAST_RUNS
from nlbench.statistics.uncertainty import NORMAL_975

if TYPE_CHECKING:
    from nlbench.reproduce.summary import JudgedClaim

Two = tuple[str, str]  # because, change
# Standard errors that a margin must measure to be decided: 3 for Holm's test of some twenty comparisons at 5 %, and .84
# more so that four of five experiments of that size reach it.
NEEDED = 3.84


def not_testable(reason: str) -> Two:
    """Nothing was tested."""
    because = reason or "the source draws no conclusion from it that a test could decide"
    return (
        f"{_capital(because)}.",
        "Numbers or words of the source that a test could decide.",
    )


def differs(claims: Sequence[JudgedClaim]) -> Two:
    """Claims of the source are refuted, and few of its sets would show them."""
    first = claims[0]
    text = f"{_named(first)}, “{first.says}”, is refuted: {_margin(first)}"
    if first.source_share is not None:
        text += f", and {_seen(first)} show it"
    return (
        f"{text}{_others(claims)}.",
        "Other parameters than those inferred or chosen, or another reading of the source's words; not more runs.",
    )


def inconclusive(claims: Sequence[JudgedClaim]) -> Two:
    """Claims are undecided, or refuted though the source may have seen them."""
    first = next((claim for claim in claims if claim.verdict == "refuted"), claims[0])
    named = f"{_named(first)}, “{first.says}”, is"
    if first.verdict == "refuted":
        return (
            f"{named} refuted, {_margin(first)}, yet {_seen(first)} show it{_others(claims)}.",
            f"A source of more runs: what {_seen(first)} show by chance is no evidence.",
        )
    return f"{named} undecided: {_margin(first)}{_others(claims)}.", _undecided(first)


def reproduced(claims: Sequence[JudgedClaim]) -> Two:
    """All claims of the source hold."""
    count = "The claim" if len(claims) == 1 else f"All {len(claims)} claims"
    verb = "is" if len(claims) == 1 else "are"
    text = f"{count} of the source {verb} confirmed over {_runs(min(claim.n for claim in claims))}"
    known = [claim for claim in claims if claim.source_share is not None]
    if known:
        rarest = min(known, key=lambda claim: claim.source_share or 0.0)
        text += f"; {_seen(rarest)} show {rarest.id} of {rarest.experiment}"
    return (
        f"{text}.",
        "Other parameters than those inferred or chosen; another seed with a probability of at most 5 %.",
    )


def runs_needed(estimate: float, low: float, high: float, n: int) -> int | None:
    """About how many runs decide a comparison whose margin and 95 % interval over n runs are these.

    None where none would: the margin is zero or unknown.
    """
    stderr = (high - low) / (2 * NORMAL_975)
    if not math.isfinite(stderr) or not math.isfinite(estimate) or estimate == 0:
        return None
    return max(n + 1, LEAST_RUNS, math.ceil(n * (NEEDED * stderr / abs(estimate)) ** 2))


def _undecided(claim: JudgedClaim) -> str:
    if claim.n < LEAST_RUNS:
        return f"More runs: fewer than {LEAST_RUNS} decide nothing."
    needed = runs_needed(claim.estimate, claim.low, claim.high, claim.n)
    if needed is None:
        return "Another statistic: this one says nothing here, however many runs there are."
    tendency = "confirm" if claim.estimate < 0 else "refute"
    return f"About {_rounded(needed):,} runs: if the margin is what it seems, they would {tendency} it."


def _margin(claim: JudgedClaim) -> str:
    """How far the comparison that supports the claim least is from it."""
    value, low, high = claim.estimate, claim.low, claim.high
    runs = _runs(claim.n)
    if not math.isfinite(value):
        return f"a statistic that it compares cannot be computed from {runs}"
    if claim.form == "printed":
        words = "a printed number is off by"
    elif value < 0:
        words, value, low, high = "where it is weakest, it holds by", -value, -high, -low
    else:
        words = "it fails by"
    return f"{words} {value:.3g} [{low:.3g}, {high:.3g}] over {runs}"


def _named(claim: JudgedClaim) -> str:
    return f"Claim {claim.id} of {claim.experiment}"


def _seen(claim: JudgedClaim) -> str:
    percent = 100 * (claim.source_share or 0.0)
    return f"{percent:.{0 if percent >= 10 else 1}f} % of sets of {_runs(claim.source_runs)}"


def _others(claims: Sequence[JudgedClaim]) -> str:
    left = len(claims) - 1
    return f" ({left} more claim{'s' if left > 1 else ''} alike)" if left else ""


def _runs(count: int | None) -> str:
    return "one run" if count == 1 else f"{count or 0:,} runs"


def _rounded(count: int) -> int:
    """To two digits, upwards."""
    unit = 10 ** max(0, len(str(count)) - 2)
    return -(-count // unit) * unit


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
