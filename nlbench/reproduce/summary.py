"""What a reproduction found: the record from which tables, the page and the printed verdicts are made."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple


class Share(NamedTuple):
    """In which share of `sets` sets of `runs` runs a claim shows, with its 95 % interval."""

    runs: int
    sets: int
    share: float
    low: float
    high: float


class JudgedClaim(NamedTuple):
    """One claim of an experiment file with the outcome of its test.

    `whose` is "source" or "ours"; `verdict` is "confirmed", "refuted" or "undecided"; `standing` is "holds",
    "inconclusive" or "differs" (see `verdicts`). `test` says the comparison in words, `form` is its kind.
    `estimate` with its 95 % interval `low`, `high` is the margin by which the claim fails: it holds where the margin is
    below zero; of several comparisons the one that supports it least. Where `form` is "printed", it is a printed number
    minus the measured one. `n` is the number of runs behind it. `figures` are the numbers that the claim names, none
    for all of its file. `shares` are how often sets of few runs show it; `source_runs` is the source's number of runs.
    """

    experiment: str
    id: str
    says: str
    test: str
    form: str
    where: str
    whose: str
    figures: tuple[str, ...]
    verdict: str
    standing: str
    estimate: float
    low: float
    high: float
    n: int
    source_runs: int | None
    shares: tuple[Share, ...]

    @property
    def source_share(self) -> float | None:
        """The share of sets of the source's size that show it; None where that is not known."""
        return next((each.share for each in self.shares if each.runs == self.source_runs), None)


class PictureFile(NamedTuple):
    """A picture of one experiment, as files.

    `experiment` is "" where the picture needs no run. `name` is its file name in the run's folder, such as "rms-x".
    `title` and `description` are those in the SVG. `svg` and `png` lie in the run's folder; `small` is the SVG for an
    entry of a document, in the folder of the reproduction, where there is one.
    """

    experiment: str
    name: str
    title: str
    description: str
    svg: Path
    png: Path
    small: Path | None


class ExperimentRun(NamedTuple):
    """One experiment as far as it was run.

    `question` is the first line of its file, `file` the path of the file and `text` what it says, comments on the
    standing of its parameters (printed, inferred, chosen) included. `state` is "done", "failed" (`fault` says why),
    or "not run". `folder` holds the results: `report` is its page, `csv` are its tables.
    `runs`, `seed`, `hash`, `seconds` (computing time in all) are 0 or "" where it was not run.
    """

    name: str
    question: str
    file: Path
    text: str
    state: str
    fault: str
    runs: int
    source_runs: int | None
    seed: int
    hash: str
    seconds: float
    folder: Path | None
    report: Path | None
    csv: tuple[Path, ...]


class Entry(NamedTuple):
    """One figure, table or point of a document, with its verdict.

    `kind` is "figure", "table" or "point"; `number` is the source's, for a point its short name. `because` and `change`
    are one sentence each: why the verdict is what it is, and what would change it. `experiments` are names, keys of
    `Summary.experiments`. `claims` are those that name the entry: the source's first, then ours, which do not count.
    """

    document: str
    kind: str
    number: str
    caption: str
    verdict: str
    because: str
    change: str
    experiments: tuple[str, ...]
    claims: tuple[JudgedClaim, ...]
    pictures: tuple[PictureFile, ...]

    @property
    def name(self) -> str:
        """As one says it: "figure 7.18", "table 8.1"; of a point its short name."""
        return self.number if self.kind == "point" else f"{self.kind} {self.number}"

    @property
    def slug(self) -> str:
        """Fit for a file name, a link or an identifier; unique among all documents."""
        return re.sub(r"[^a-z0-9]+", "-", f"{self.document}-{self.kind}-{self.number}".lower()).strip("-")


class Document(NamedTuple):
    """A source and its entries, in its own order."""

    name: str
    title: str
    citation: str
    entries: tuple[Entry, ...]


class Effect(NamedTuple):
    """What an erratum changes, measured: one statistic of two filters that see the same runs.

    `against` is the experiment of the corrected filter where it is another, "" where it is the same.
    `printed` and `corrected` are values with standard errors; `difference` is printed minus corrected, of paired runs,
    with its standard error. A number that cannot be had is NaN. `printed_diverged` and `corrected_diverged` are
    fractions of the runs.
    """

    experiment: str
    against: str
    statistic: str
    coordinate: str
    time: float
    printed_label: str
    corrected_label: str
    printed: float
    printed_stderr: float
    corrected: float
    corrected_stderr: float
    difference: float
    difference_stderr: float
    printed_diverged: float
    corrected_diverged: float
    n: int


class Erratum(NamedTuple):
    """A numbered error in a source: its equation, what is printed, what is right, and what that changes.

    `document` is the source's name, `number` such as "C3". `effects` are empty where `why_not` says why there are none.
    """

    document: str
    number: str
    equation: str
    printed: str
    right: str
    consequence: str
    why_not: str
    effects: tuple[Effect, ...]


class Summary(NamedTuple):
    """All that a reproduction found.

    `mode` is "quick" or "full"; `command` makes it again; `finished` is a time in UTC as ISO 8601; `seconds` is how
    long this call took, `computing` the computing time of all runs it rests on, those of earlier calls included.
    `experiments` go by name. `totals` count the entries by verdict, in the order of `verdicts.VERDICTS`.
    `environment` are pairs of a name and a value: versions, processor, device, commit. `folder` is where the summary
    lies; paths in the other records are absolute or relative to the working folder.
    """

    mode: str
    folder: Path
    command: str
    finished: str
    seconds: float
    computing: float
    documents: tuple[Document, ...]
    experiments: dict[str, ExperimentRun]
    errata: tuple[Erratum, ...]
    totals: dict[str, int]
    environment: tuple[tuple[str, str], ...]

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Of all documents."""
        return tuple(entry for document in self.documents for entry in document.entries)
