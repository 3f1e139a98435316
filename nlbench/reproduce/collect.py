"""What the folder of an experiment says: how it was run, and how its claims stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.reproduce.summary import ExperimentRun, JudgedClaim, Share
from nlbench.reproduce.verdicts import standing
from nlbench.reproduce.wording import in_words
from nlbench.results.results import Results

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Claim
    from nlbench.reproduce.driver import Outcome
    from nlbench.reproduce.jobs import Job

FINISHED = (
    0,
    4,
)  # exit codes after which there are results; with 4, a filter failed or diverged beyond its limit


def experiment_run(job: Job, outcome: Outcome | None) -> ExperimentRun:
    """The record of an experiment; without an outcome it was not run."""
    experiment = job.experiment
    common: dict[str, Any] = {
        "name": job.name,
        "question": experiment.question,
        "file": job.file,
        "text": job.file.read_text("utf-8"),
        "source_runs": experiment.source.runs,
    }
    if outcome is None or outcome.code not in FINISHED:
        state = "not run" if outcome is None else "failed"
        fault = outcome.fault if outcome else ""
        absent: dict[str, Any] = {
            "runs": 0,
            "seed": 0,
            "hash": "",
            "seconds": 0.0,
            "folder": None,
            "report": None,
            "csv": (),
        }
        return ExperimentRun(**common, state=state, fault=fault, **absent)
    manifest = Results(job.folder).manifest
    return ExperimentRun(
        **common,
        state="done",
        fault=outcome.fault,
        runs=manifest["runs"],
        seed=manifest["seed"],
        hash=manifest["hash"],
        seconds=manifest["seconds"],
        folder=job.folder,
        report=job.folder / "report.html",
        csv=tuple(sorted((job.folder / "tables").glob("*.csv"))),
    )


def judged_claims(job: Job) -> tuple[JudgedClaim, ...]:
    """The claims of a finished experiment, in the order of its file."""
    results = Results(job.folder)
    if "claims" not in results.tables:
        return ()
    shares = _shares(results.table("sets")) if "sets" in results.tables else {}
    claims = {claim.id: claim for claim in results.experiment.claims}
    rows = results.table("claims").itertuples()
    return tuple(_judged(job, claims[row.id], row, shares.get(row.id, ())) for row in rows)


def _judged(job: Job, claim: Claim, row: object, shares: tuple[Share, ...]) -> JudgedClaim:
    source_runs = job.experiment.source.runs
    at_source = next((each.share for each in shares if each.runs == source_runs), None)
    verdict, estimate, low, high, n = (
        getattr(row, key) for key in ("verdict", "estimate", "low", "high", "n")
    )
    return JudgedClaim(
        experiment=job.name,
        id=claim.id,
        says=claim.says,
        test=in_words(claim, job.experiment),
        form=claim.form,
        where=claim.where or "",
        whose=claim.whose,
        figures=tuple(claim.figures or ()),
        verdict=verdict,
        standing=standing(verdict, at_source),
        estimate=float(estimate),
        low=float(low),
        high=float(high),
        n=int(n),
        source_runs=source_runs,
        shares=shares,
    )


def _shares(sets: pd.DataFrame) -> dict[str, tuple[Share, ...]]:
    return {
        str(id): tuple(
            Share(int(row.runs), int(row.sets), float(row.share), float(row.low), float(row.high))
            for row in rows.itertuples()
        )
        for id, rows in sets.groupby("id", sort=False)
    }
