"""What a reproduction found, invented: two sources, every verdict, an experiment that failed, errata.

`strings` stand in all places in which text of users may stand.
"""

from __future__ import annotations

import math
from html import escape
from itertools import cycle, islice
from pathlib import Path

from nlbench.reproduce.summary import (
    Document,
    Effect,
    Entry,
    Erratum,
    ExperimentRun,
    JudgedClaim,
    PictureFile,
    Share,
    Summary,
)
from nlbench.reproduce.verdicts import VERDICTS

PLAIN = ("order three beats order two",)
TEXT = """# {0}
experiment: {1}

# Printed: the drift. Inferred: the noise, {0}. Chosen: the ensemble.
system: {{name: culver-scalar}}
time: {{end: 2.0}} # end printed; steps chosen
"""
SVG = """<?xml version="1.0" encoding="utf-8"?>
<svg role="img" aria-labelledby="t d" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 288 216">
<title id="t">{0}</title>
<desc id="d">{0}</desc>
<rect id="frame" width="288" height="216" fill="#dde" /><path id="a" d="M 0 0
L 288 216" stroke="#a33" style="stroke-width: 50%"/>
</svg>
"""


def summary(folder: Path, strings: tuple[str, ...] = PLAIN, entries: int = 6, svg: str = SVG) -> Summary:
    """In the folder of a reproduction, with the files that it names. `entries` of each source."""
    said = cycle(strings)
    experiments = {
        name: _experiment(folder, name, state, next(said), svg)
        for name, state in (("culver/a", "done"), ("schwartz/b", "done"), ("schwartz/c", "failed"))
    }
    documents = (
        Document("culver-1969", next(said), next(said), _entries("culver-1969", folder, entries, said, svg)),
        Document(
            "schwartz-1967", next(said), next(said), _entries("schwartz-1967", folder, entries, said, svg)
        ),
    )
    for name in ("verdicts.csv", "claims.csv"):
        (folder / name).write_text("document,entry\n")
    everything = [entry for document in documents for entry in document.entries]
    return Summary(
        mode="quick",
        folder=folder,
        command=f"nlbench reproduce --quick {next(said)}",
        finished="2026-01-02T03:04:05+00:00",
        seconds=234.5,
        computing=4567.8,
        documents=documents,
        experiments=experiments,
        errata=_errata(said),
        totals={verdict: sum(entry.verdict == verdict for entry in everything) for verdict in VERDICTS},
        environment=(("nlbench", "1.2.3"), ("device", next(said))),
    )


def _experiment(folder: Path, name: str, state: str, words: str, svg: str) -> ExperimentRun:
    run = folder.parent / name
    for part in ("tables", "figures"):
        (run / part).mkdir(parents=True, exist_ok=True)
    csv = tuple(run / "tables" / f"{table}.csv" for table in ("claims", "sets", "statistics"))
    for path in csv:
        path.write_text("id\n")
    (run / "figures" / "rms-x.svg").write_text(svg.format(escape(words)), "utf-8")
    (run / "figures" / "rms-x.png").write_bytes(b"")
    (run / "report.html").write_text("")
    file = folder.parent / f"{name.replace('/', '-')} file.yaml"
    text = TEXT.format(words, name)
    file.write_text(text, "utf-8")
    done = state == "done"
    return ExperimentRun(
        name, words, file, text, state, "" if done else words, 20_000 * done, 80, 1969 * done, "0123456789ab" * done,
        12.3 * done, run if done else None, run / "report.html" if done else None, csv if done else (),
    )  # fmt: skip


def _entries(document: str, folder: Path, count: int, said: cycle[str], svg: str) -> tuple[Entry, ...]:
    experiments = ("culver/a",) if document == "culver-1969" else ("schwartz/b", "schwartz/c")
    found = []
    for place, verdict in enumerate(islice(cycle(VERDICTS), count), start=1):
        tested = verdict != "NOT TESTABLE"
        number = f"7.{place}"
        pictures = _picture(folder, experiments[0], f"{document}-{place}", next(said), svg) if tested else ()
        claims = (
            tuple(_claim(experiments[0], number, place, next(said)) for place in range(3)) if tested else ()
        )
        found.append(
            Entry(
                document=document,
                kind="table" if place == count else "figure",
                number=number,
                caption=next(said),
                verdict=verdict,
                because=next(said),
                change=next(said),
                experiments=experiments if tested else (),
                claims=claims,
                pictures=pictures,
            )
        )
    return tuple(found)


def _picture(folder: Path, experiment: str, name: str, words: str, svg: str) -> tuple[PictureFile, ...]:
    run = folder.parent / experiment / "figures"
    small = folder / "figures" / f"{name}-rms-x.svg"
    small.parent.mkdir(parents=True, exist_ok=True)
    small.write_text(svg.format(escape(words)), "utf-8")
    return (PictureFile(experiment, "rms-x", words, words, run / "rms-x.svg", run / "rms-x.png", small),)


def _claim(experiment: str, number: str, place: int, words: str) -> JudgedClaim:
    verdict, standing, whose = (
        ("confirmed", "holds", "source"),
        ("refuted", "differs", "source"),
        ("undecided", "inconclusive", "ours"),
    )[place]
    shares = (Share(10, 2_000, 0.63, 0.61, 0.65), Share(80, 2_000, 0.931, 0.92, 0.94))
    return JudgedClaim(
        experiment=experiment,
        id=f"C{place}",
        says=words,
        test=words,
        form="less",
        where="section 7.3, page 7-9" if whose == "source" else "",
        whose=whose,
        figures=(number,),
        verdict=verdict,
        standing=standing,
        estimate=-0.0123,
        low=-0.02,
        high=0.004,
        n=20_000,
        source_runs=80,
        shares=shares,
    )


def _errata(said: cycle[str]) -> tuple[Erratum, ...]:
    effect = Effect(
        experiment="culver/a",
        against="",
        statistic="rms_clipped",
        coordinate="x",
        time=2.0,
        printed_label=next(said),
        corrected_label="third-order",
        printed=0.25,
        printed_stderr=0.004,
        corrected=0.24,
        corrected_stderr=0.004,
        difference=0.01,
        difference_stderr=0.001,
        printed_diverged=0.02,
        corrected_diverged=0.0,
        n=20_000,
    )
    unknown = effect._replace(against="schwartz/b", printed=math.nan, difference=math.nan)
    return (
        Erratum("culver-1969", "C3", "(7.6)", next(said), next(said), next(said), "", (effect, unknown)),
        Erratum("schwartz-1967", "S1", "(82)", next(said), next(said), next(said), next(said), ()),
    )
