"""All that stands on the page and in its Markdown twin, gathered from the summary."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from nlbench.report.tables import Table
from nlbench.reproduce.page import overview
from nlbench.reproduce.page.links import Link, links
from nlbench.reproduce.page.overview import Corrected, Count
from nlbench.reproduce.page.sections import Chapter, chapters
from nlbench.reproduce.summary import Summary

TITLE = "Every figure and table of the sources, with a verdict"
TABLES = ("verdicts.csv", "claims.csv")  # of the whole reproduction, beside the page


class Contents(NamedTuple):
    """Names are those of the template's variables."""

    title: str
    mode: str
    command: str
    counts: list[Count]
    summary_facts: list[tuple[str, str]]
    reading: tuple[str, ...]
    files: tuple[Link, ...]
    verdicts: Table
    chapters: tuple[Chapter, ...]
    errata: list[Corrected]
    assumptions: Table
    environment: tuple[tuple[str, str], ...]


def contents(summary: Summary, folder: Path) -> Contents:
    """For a page that will lie in `folder`."""
    found = chapters(summary, folder)
    return Contents(
        TITLE,
        summary.mode,
        summary.command,
        overview.counts(summary),
        overview.facts(summary),
        overview.READING,
        links((folder / name for name in TABLES if (folder / name).exists()), folder),
        overview.index(found),
        found,
        overview.errata(summary),
        overview.assumptions(summary),
        summary.environment,
    )
