"""From finished experiments to the summary: claims gathered, verdicts reached, pictures found."""

from __future__ import annotations

import datetime
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.reproduce import pictures
from nlbench.reproduce.checks import CHECKS
from nlbench.reproduce.collect import experiment_run, judged_claims
from nlbench.reproduce.effects import erratum
from nlbench.reproduce.summary import Document, Entry, ExperimentRun, JudgedClaim, Summary
from nlbench.reproduce.verdicts import VERDICTS, Verdict, judged, unfinished
from nlbench.results.results import Results

if TYPE_CHECKING:
    from nlbench.reproduce.documents import Item
    from nlbench.reproduce.driver import Outcome
    from nlbench.reproduce.jobs import Chosen, Job

SAID_BESIDE = ("device", "precision", "commit")  # of a manifest, beside versions and fingerprint


class Call(NamedTuple):
    """What was asked for: the mode, the folder of the summary, the command that makes it again, the time it took."""

    mode: str
    folder: Path
    command: str
    seconds: float


def summarise(chosen: Chosen, jobs: list[Job], outcomes: Mapping[str, Outcome], call: Call) -> Summary:
    """The summary; its small pictures are written into the folder."""
    experiments = {job.name: experiment_run(job, outcomes.get(job.name)) for job in jobs}
    claims = {job.name: judged_claims(job) for job in jobs if experiments[job.name].state == "done"}
    documents = []
    for source, items in chosen.entries:
        entries = tuple(_entry(source.name, item, experiments, claims, call.folder) for item in items)
        documents.append(Document(source.name, source.title, source.citation, entries))
    summary = Summary(
        mode=call.mode,
        folder=call.folder,
        command=call.command,
        finished=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        seconds=call.seconds,
        computing=sum(run.seconds for run in experiments.values()),
        documents=tuple(documents),
        experiments=experiments,
        errata=tuple(erratum(error, experiments) for error in chosen.errors),
        totals={},
        environment=_environment(experiments),
    )
    counts = Counter(entry.verdict for entry in summary.entries)
    pictures.sweep(call.folder / "figures", [each for entry in summary.entries for each in entry.pictures])
    return summary._replace(totals={verdict: counts[verdict] for verdict in VERDICTS})


def _entry(
    document: str,
    item: Item,
    experiments: Mapping[str, ExperimentRun],
    claims: Mapping[str, tuple[JudgedClaim, ...]],
    folder: Path,
) -> Entry:
    runs = [experiments[name] for name in item.experiments]
    about = [claim for name in item.experiments for claim in claims.get(name, ()) if _names(claim, item)]
    about.sort(key=lambda claim: claim.whose != "source")
    entry = Entry(
        document=document,
        kind=item.kind,
        number=item.number,
        caption=item.caption,
        **_verdict(item, runs, about)._asdict(),
        experiments=item.experiments,
        claims=tuple(about),
        pictures=(),
    )
    return entry._replace(pictures=pictures.of(item, entry.slug, runs, folder / "figures"))


def _names(claim: JudgedClaim, item: Item) -> bool:
    """Whether a claim is about the entry: it names its number, or none."""
    return not claim.figures or item.number in claim.figures


def _verdict(item: Item, runs: list[ExperimentRun], claims: list[JudgedClaim]) -> Verdict:
    if item.check:
        return CHECKS[item.check]()
    missing = [
        f"{run.name} {'failed' if run.fault else 'was not run'}" for run in runs if run.state != "done"
    ]
    return unfinished(missing) if missing else judged(claims, item.reason)


def _environment(experiments: Mapping[str, ExperimentRun]) -> tuple[tuple[str, str], ...]:
    """Software and hardware of all experiments; where they differ, all values."""
    found: dict[str, dict[str, None]] = {}
    for run in experiments.values():
        if run.folder is not None:
            for key, value in _said(Results(run.folder).manifest):
                found.setdefault(key, {})[value] = None
    return tuple((key.replace("_", " "), ", ".join(values)) for key, values in found.items())


def _said(manifest: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield from sorted(manifest.get("versions", {}).items())
    fingerprint = {key: value for key, value in manifest.get("fingerprint", {}).items() if key != "program"}
    yield from ((key, str(value)) for key, value in sorted(fingerprint.items()))
    yield from ((key, str(manifest[key])) for key in SAID_BESIDE if manifest.get(key))
