"""What stands in the section of one figure or table, in words: the same for the page and for its Markdown twin."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from nlbench.report.numbers import duration, listed, ranged, share
from nlbench.report.tables import VERDICTS as OUTCOMES
from nlbench.reproduce.page.links import Link, address, links
from nlbench.reproduce.page.pictures import Shown, shown
from nlbench.reproduce.page.standing import Standing, standing
from nlbench.reproduce.summary import Document, Entry, ExperimentRun, JudgedClaim, PictureFile, Summary
from nlbench.reproduce.verdicts import VERDICTS

MARKS = dict(zip(VERDICTS, "✓✓?✗–", strict=True))
STANDINGS = {
    "holds": "holds",
    "inconclusive": "inconclusive at the source's number of runs",
    "differs": "differs",
}


class Tested(NamedTuple):
    """A claim, what became of it, and the numbers behind that."""

    name: str
    origin: str
    says: str
    outcome: str
    kind: str
    test: str
    facts: tuple[tuple[str, str], ...]
    links: tuple[Link, ...]


class Ran(NamedTuple):
    """An experiment of the section. `first` names the section that shows its file on paper, if it is another one."""

    name: str
    question: str
    state: str
    standing: Standing
    text: str
    file: Link
    links: tuple[Link, ...]
    first: str


class Section(NamedTuple):
    """One figure, table or point. `kind` is a class that goes with the verdict."""

    slug: str
    name: str
    number: str
    caption: str
    verdict: str
    mark: str
    kind: str
    because: str
    change: str
    pictures: tuple[Shown, ...]
    claims: tuple[Tested, ...]
    experiments: tuple[Ran, ...]


class Chapter(NamedTuple):
    """A source and its sections."""

    slug: str
    name: str
    title: str
    citation: str
    sections: tuple[Section, ...]


def chapters(summary: Summary, folder: Path) -> tuple[Chapter, ...]:
    """All sources with all their sections."""
    seen: dict[str, str] = {}
    return tuple(
        Chapter(
            identifier(f"source-{document.name}"),
            short(document),
            document.title,
            document.citation,
            tuple(_section(entry, document, summary, folder, seen) for entry in document.entries),
        )
        for document in summary.documents
    )


def short(document: Document) -> str:
    """`Culver 1969` for culver-1969."""
    return document.name.replace("-", " ").title()


def identifier(text: str) -> str:
    """Fit for an identifier, a link and a class."""
    return re.sub(r"[^A-Za-z0-9_]+", "-", text).strip("-")


def _section(
    entry: Entry, document: Document, summary: Summary, folder: Path, seen: dict[str, str]
) -> Section:
    """`seen` are the experiments of the sections before, with the place where each stands first."""
    name = entry.name[:1].upper() + entry.name[1:]
    ran = []
    for each in entry.experiments:
        first = seen.setdefault(each, f"{short(document)}, {entry.name}")
        ran.append(
            _ran(
                summary.experiments[each],
                folder,
                "" if first == f"{short(document)}, {entry.name}" else first,
            )
        )
    return Section(
        identifier(entry.slug), name, entry.number, entry.caption, entry.verdict, MARKS[entry.verdict],
        identifier(entry.verdict.lower()), entry.because, entry.change,
        tuple(_shown(picture, entry, folder) for picture in entry.pictures),
        tuple(_tested(claim, summary, folder) for claim in entry.claims),
        tuple(ran),
    )  # fmt: skip


def _shown(picture: PictureFile, entry: Entry, folder: Path) -> Shown:
    """The picture, titled with its experiment where the entry has several."""
    if len(entry.experiments) > 1 and picture.experiment:
        picture = picture._replace(title=f"{picture.experiment}: {picture.title}")
    return shown(picture, alternative(entry, picture.title), folder)


def alternative(entry: Entry, title: str) -> str:
    """What a picture says to those who cannot see it: the verdict, what was claimed, and what is drawn."""
    said = "; ".join(claim.says for claim in entry.claims if claim.whose == "source")
    claimed = f"claimed: {said}" if said else entry.caption
    return f"{entry.name[:1].upper() + entry.name[1:]}, {entry.verdict}, {claimed}. Drawn: {title}"


def _tested(claim: JudgedClaim, summary: Summary, folder: Path) -> Tested:
    whose = "of the source" if claim.whose == "source" else "ours, which does not count for the verdict"
    counted = f", {STANDINGS.get(claim.standing, claim.standing)}" if claim.whose == "source" else ""
    margin = "printed minus measured" if claim.form == "printed" else "margin"
    facts = [
        (f"{margin} [95 % interval]", ranged(claim.estimate, claim.low, claim.high)),
        ("runs", f"{claim.n:,}"),
        *((f"sets of {each.runs:,}{' (as the source)' * (each.runs == claim.source_runs)}",
           f"seen in {share(each.share, each.low, each.high)}") for each in claim.shares),
    ]  # fmt: skip
    return Tested(
        f"{claim.experiment} {claim.id}",
        ", ".join(filter(None, (whose, claim.where))),
        claim.says,
        f"{OUTCOMES.get(claim.verdict, claim.verdict)}{counted}",
        claim.verdict,
        claim.test,
        tuple(facts),
        links(_of_claims(summary.experiments.get(claim.experiment)), folder),
    )


def _of_claims(experiment: ExperimentRun | None) -> list[Path]:
    """The tables with the numbers of a claim."""
    tables = experiment.csv if experiment else ()
    return [path for path in tables if path.stem in ("claims", "sets")]


def _ran(experiment: ExperimentRun, folder: Path, first: str) -> Ran:
    report = [Link("report of the run", address(experiment.report, folder))] if experiment.report else []
    return Ran(
        experiment.name,
        experiment.question,
        _state(experiment),
        standing(experiment.text),
        experiment.text,
        Link(experiment.file.name, address(experiment.file, folder)),
        (*report, *links(experiment.csv, folder)),
        first,
    )


def _state(experiment: ExperimentRun) -> str:
    """What was run, or why nothing was."""
    if experiment.state != "done":
        return ": ".join(filter(None, (experiment.state, experiment.fault)))
    parts = [f"{experiment.runs:,} runs"]
    if experiment.source_runs:
        parts.append(f"the source had {experiment.source_runs:,}")
    parts += [f"seed {experiment.seed}", duration(experiment.seconds), f"results {experiment.hash}"]
    return listed(parts)
