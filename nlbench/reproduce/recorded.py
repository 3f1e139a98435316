"""Verdicts on record, so that a change of the program that changes one is noticed."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import NamedTuple

from nlbench.errors import DamagedResults
from nlbench.reproduce.summary import Entry, Summary
from nlbench.results.atomic import atomic_write

NAME = "recorded.csv"
COLUMNS = ("mode", "document", "entry", "runs", "verdict")


class Row(NamedTuple):
    """The verdict on one entry. `runs` are those of each of its experiments, joined by spaces."""

    mode: str
    document: str
    entry: str
    runs: str
    verdict: str

    @property
    def key(self) -> tuple[str, str, str]:
        """What is recorded once."""
        return self.mode, self.document, self.entry


class Compared(NamedTuple):
    """How many verdicts are as recorded, the pairs (recorded, found) that are not, and how many cannot be compared."""

    same: int
    changed: tuple[tuple[Row, Row], ...]
    other_runs: int
    unknown: int


def rows(summary: Summary) -> list[Row]:
    """The verdicts that may be compared or recorded: those whose experiments were all run."""
    return [
        Row(summary.mode, entry.document, entry.name, _runs(entry, summary), entry.verdict)
        for entry in summary.entries
        if all(summary.experiments[name].state == "done" for name in entry.experiments)
    ]


def compare(summary: Summary, path: Path) -> Compared:
    """The verdicts against those on record; only of the same numbers of runs, since more runs may well decide more."""
    known = {row.key: row for row in read(path)}
    found = rows(summary)
    pairs = [(known[row.key], row) for row in found if row.key in known]
    alike = [(before, now) for before, now in pairs if before.runs == now.runs]
    changed = tuple((before, now) for before, now in alike if before.verdict != now.verdict)
    return Compared(len(alike) - len(changed), changed, len(pairs) - len(alike), len(found) - len(pairs))


def record(summary: Summary, path: Path) -> int:
    """Put these verdicts on record; those of other entries and modes stay. Returns how many."""
    kept = {row.key: row for row in read(path)}
    found = rows(summary)
    kept |= {row.key: row for row in found}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows(kept.values())
    atomic_write(path, text.getvalue().encode())
    return len(found)


def read(path: Path) -> list[Row]:
    """What is on record; nothing where there is no such file. Raises `DamagedResults`."""
    try:
        lines = list(csv.reader(path.read_text("utf-8").splitlines()))
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError) as error:
        raise DamagedResults(f"{path}: cannot be read ({error})") from error
    if not lines or tuple(lines[0]) != COLUMNS or any(len(line) != len(COLUMNS) for line in lines):
        raise DamagedResults(f"{path}: not a record of verdicts, whose columns are {', '.join(COLUMNS)}")
    return [Row(*line) for line in lines[1:]]


def _runs(entry: Entry, summary: Summary) -> str:
    return " ".join(str(summary.experiments[name].runs) for name in entry.experiments)
