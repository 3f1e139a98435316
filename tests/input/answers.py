"""What a command answers to spoiled input, and what no answer may be."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner

from nlbench.cli.app import app

LONGEST_LINE = 1000


class Answer(NamedTuple):
    """Exit code, what was printed, and the seconds that it took."""

    code: int
    said: str
    seconds: float


def answer(*arguments: str | Path) -> Answer:
    """What `nlbench` says."""
    begun = time.perf_counter()
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    return Answer(result.exit_code, result.output, time.perf_counter() - begun)


def faults(given: Answer, allowed: tuple[int, ...], named: str) -> list[str]:
    """What is wrong with an answer; one that is not 0 must name what is wrong."""
    found = {
        f"exit code {given.code}": given.code not in allowed,
        "a traceback": "Traceback" in given.said or "internal error" in given.said,
        "an unprintable character": not all(each.isprintable() or each == "\n" for each in given.said),
        "no word": not given.said.strip(),
        f"a line of more than {LONGEST_LINE:,} characters": max(map(len, given.said.split("\n")))
        > LONGEST_LINE,
        f"no {named}": given.code != 0 and named not in given.said,
    }
    return [name for name, holds in found.items() if holds]
