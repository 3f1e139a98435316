"""What the page says of all figures together: counts, the table of verdicts, errata, assumptions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from nlbench.report.numbers import duration, percent, plain, uncertain
from nlbench.report.tables import Cell, Table, name, number, prose
from nlbench.report.winners import WORDS
from nlbench.reproduce.page.sections import MARKS, Chapter, identifier, short
from nlbench.reproduce.page.standing import standing
from nlbench.reproduce.summary import Effect, Erratum, Summary
from nlbench.reproduce.verdicts import VERDICTS

MEANINGS = (
    "every claim of the source holds, the numbers that it prints included",
    "every claim of the source holds; its figure or its numbers are not there to be compared",
    "a claim is undecided, or many runs refute it although at least 5 % of sets of the source's size show it:"
    " what the source saw may have been chance",
    "a claim is refuted, and that the source had few runs does not explain it",
    "the source claims nothing of it that runs can test, or what that needs is lost",
)
READING = (
    "Each claim of a source was turned into comparisons before anything was run; they stand in the experiment's file."
    " All filters of an experiment see the same runs and the same noise. A claim is confirmed if every comparison is"
    " significant in its direction, at 5 % with Holm's correction over all comparisons of the file; refuted if one is"
    " significant in the other; undecided otherwise.",
    "The margin is by how much the comparison fails that supports the claim least: negative where the claim holds."
    " Of numbers that a source prints, it is printed minus measured.",
    "Sets of few runs, drawn from all of them, tell what an author with one such set was likely to see: in how many of"
    " them the claim shows, significant or not.",
    "Claims that are ours count for no verdict.",
)


class Count(NamedTuple):
    """How many entries have a verdict, and what it means."""

    verdict: str
    mark: str
    kind: str
    entries: int
    meaning: str


class Corrected(NamedTuple):
    """An erratum, with the table of its effects if they were measured."""

    slug: str
    title: str
    rows: tuple[tuple[str, str], ...]
    effects: Table | None
    why_not: str


def counts(summary: Summary) -> list[Count]:
    """One for each verdict, also for those that nothing has."""
    return [
        Count(verdict, MARKS[verdict], identifier(verdict.lower()), summary.totals.get(verdict, 0), meaning)
        for verdict, meaning in zip(VERDICTS, MEANINGS, strict=True)
    ]


def facts(summary: Summary) -> list[tuple[str, str]]:
    """Of the card at the top."""
    done = [each for each in summary.experiments.values() if each.state == "done"]
    seeds = sorted({each.seed for each in done})
    return [
        ("figures, tables and points", f"{len(summary.entries):,}"),
        ("experiments", f"{len(done):,} of {len(summary.experiments):,}"),
        ("runs", f"{sum(each.runs for each in done):,}"),
        ("computing time", duration(summary.computing)),
        ("this call", duration(summary.seconds)),
        ("seeds", ", ".join(map(str, seeds)) or "–"),
        *((key, value) for key, value in summary.environment if key in ("nlbench", "commit")),
        ("mode", summary.mode),
        ("finished", summary.finished.replace("T", " ").replace("+00:00", " UTC")),
    ]


def index(chapters: Iterable[Chapter]) -> Table:
    """All entries; the first cell leads to the section."""
    rows = [
        [
            Cell(section.name, place, f"name of-{order}", f"#{section.slug}"),
            Cell(
                f"{section.mark}\u00a0{section.verdict}",
                VERDICTS.index(section.verdict),
                f"verdict {section.kind}",
            ),
            prose(section.caption),
            prose(section.because),
            Cell(chapter.name, chapter.name, "name"),
        ]
        for place, (order, chapter, section) in enumerate(
            (order, chapter, section)
            for order, chapter in enumerate(chapters, start=1)
            for section in chapter.sections
        )
    ]
    heads = ["figure or table", "verdict", "what it shows", "because", "source"]
    return Table("verdicts", "All figures and tables with their verdicts", heads, rows)


def errata(summary: Summary) -> list[Corrected]:
    """All errata, in the order of the summary."""
    titles = {document.name: short(document) for document in summary.documents}
    return [
        Corrected(
            identifier(f"erratum-{each.document}-{each.number}"),
            f"{each.number}: {titles.get(each.document, each.document)}, {each.equation}",
            (("printed", each.printed), ("right", each.right), ("consequence", each.consequence)),
            _effects(each) if each.effects else None,
            each.why_not,
        )
        for each in summary.errata
    ]


def _effects(erratum: Erratum) -> Table:
    heads = [
        "what",
        "as printed",
        "corrected",
        "printed − corrected",
        "diverged as printed",
        "diverged corrected",
        "runs",
    ]
    rows = [
        [
            prose(_what(each)),
            number(_measured(each.printed, each.printed_stderr), each.printed),
            number(_measured(each.corrected, each.corrected_stderr), each.corrected),
            number(_measured(each.difference, each.difference_stderr), each.difference),
            number(f"{percent(each.printed_diverged)}\u00a0%", each.printed_diverged),
            number(f"{percent(each.corrected_diverged)}\u00a0%", each.corrected_diverged),
            number(f"{each.n:,}", each.n),
        ]
        for each in erratum.effects
    ]
    table = identifier(f"effect-{erratum.document}-{erratum.number}")
    return Table(table, f"{erratum.number}: effect, on the same runs, ± standard error", heads, rows)


def _what(effect: Effect) -> str:
    statistic = WORDS.get(effect.statistic, effect.statistic.replace("_", " "))
    words = f"{statistic} of {effect.coordinate} at t = {plain(effect.time)} in {effect.experiment}"
    other = f" in {effect.against}" if effect.against else ""
    return f"{words}: {effect.printed_label} against {effect.corrected_label}{other}"


def _measured(value: float, stderr: float) -> str:
    return "–" if math.isnan(value) else uncertain(value, stderr)


def assumptions(summary: Summary) -> Table:
    """What the files of the experiments say is inferred or chosen, with the experiments that share it."""
    sharing: dict[tuple[str, str], list[str]] = {}
    for experiment in summary.experiments.values():
        found = standing(experiment.text)
        for word, statements in zip(found._fields, found, strict=True):
            for statement in statements:
                sharing.setdefault((word, statement), []).append(experiment.name)
    rows = [
        [name(word), prose(statement), prose(", ".join(names)), number(f"{len(names)}", len(names))]
        for (word, statement), names in sorted(
            sharing.items(), key=lambda each: (each[0][0] == "chosen", -len(each[1]))
        )
    ]
    heads = ["standing", "parameter, and why", "experiments", "how many"]
    return Table("assumptions", "Parameters that the sources do not print", heads, rows)
