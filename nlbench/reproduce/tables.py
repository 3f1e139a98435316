"""The tables of a reproduction, as CSV: one row for each entry, one for each claim."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from nlbench.reproduce.summary import JudgedClaim, Summary
from nlbench.results.atomic import atomic_write

SIZES = (10, 20, 80)  # of the sets whose shares have columns of their own, beside the source's
VERDICT_COLUMNS = ("document", "entry", "caption", "experiments", "verdict", "because", "change")
CLAIM_COLUMNS = (
    *("experiment", "id", "says", "whose", "where", "figures", "test", "verdict", "standing"),
    *("estimate", "low", "high", "n", "source_runs", "share_source", *(f"share_{size}" for size in SIZES)),
)


def write(summary: Summary) -> None:
    """Write `verdicts.csv` and `claims.csv` into the folder of the summary."""
    verdicts = [
        [e.document, e.name, e.caption, " ".join(e.experiments), e.verdict, e.because, e.change]
        for e in summary.entries
    ]
    claims = {(claim.experiment, claim.id): claim for entry in summary.entries for claim in entry.claims}
    _write(summary.folder / "verdicts.csv", VERDICT_COLUMNS, verdicts)
    _write(summary.folder / "claims.csv", CLAIM_COLUMNS, map(_claim, claims.values()))


def _claim(claim: JudgedClaim) -> list[object]:
    shares = {each.runs: each.share for each in claim.shares}
    words = [claim.experiment, claim.id, claim.says, claim.whose, claim.where, " ".join(claim.figures)]
    numbers = [f"{value:.6g}" for value in (claim.estimate, claim.low, claim.high)]
    sizes = [shares.get(size, "") for size in SIZES]
    at_source = "" if claim.source_share is None else claim.source_share
    return [
        *words,
        claim.test,
        claim.verdict,
        claim.standing,
        *numbers,
        claim.n,
        claim.source_runs or "",
        at_source,
        *sizes,
    ]


def _write(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    atomic_write(path, text.getvalue().encode())
