"""The whole way: experiments run, verdicts reached, tables and page written."""

from __future__ import annotations

import os
import shlex
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from nlbench.errors import (
    ConfigError,
    EnvironmentFault,
    GateError,
    LimitError,
    LockedError,
    NlbenchError,
)
from nlbench.reproduce import driver, jobs, recorded
from nlbench.reproduce.driver import Outcome
from nlbench.reproduce.jobs import Job
from nlbench.reproduce.recorded import Compared
from nlbench.reproduce.summary import Summary

# What a failed experiment makes of the whole, the gravest first; a changed verdict is the least of them.
GRAVITY = (NlbenchError, EnvironmentFault, ConfigError, LockedError, LimitError, GateError)


class Wanted(NamedTuple):
    """What the user asked for. `figure` and `source` are None for all; `out` and `configs` are folders."""

    source: str | None
    figure: str | None
    quick: bool
    out: Path
    configs: Path

    @property
    def mode(self) -> str:
        """quick or full."""
        return "quick" if self.quick else "full"

    @property
    def folder(self) -> Path:
        """Of the summary; a part of the sources does not overwrite the summary of all of them."""
        parts = ["reproduction", "quick" if self.quick else "", self.source or "", self.figure or ""]
        return self.out / "-".join(part.replace(" ", "-").replace("/", "-") for part in parts if part)

    @property
    def command(self) -> str:
        """The command line that asks for the same."""
        words = ["nlbench", "reproduce", *([self.source] if self.source else [])]
        words += ["--figure", self.figure] if self.figure else []
        words += ["--quick" if self.quick else "--full"]
        words += ["--out", str(self.out)] if self.out != Path("results") else []
        words += ["--configs", str(self.configs)] if self.configs != Path("configs") else []
        return shlex.join(words)

    @property
    def record(self) -> Path:
        """Where verdicts are recorded, of all modes and sources."""
        return self.out / "reproduction" / recorded.NAME


class Done(NamedTuple):
    """The summary, its page, and how its verdicts compare with those on record."""

    summary: Summary
    page: Path
    compared: Compared


def plan(wanted: Wanted) -> tuple[jobs.Chosen, list[Job]]:
    """What is to be reproduced and the experiments that it needs. Raises `ConfigError`."""
    chosen = jobs.choose(wanted.source, wanted.figure)
    return chosen, jobs.jobs(chosen, wanted.configs, wanted.out, wanted.quick)


def reproduce(
    wanted: Wanted, chosen: jobs.Chosen, needed: list[Job], report: Callable[[Outcome], None]
) -> tuple[Done, dict[str, Outcome]]:
    """Run what is missing and write the summary. `report` is called with the outcome of each experiment."""
    begun = time.monotonic()
    outcomes = driver.run(needed, wanted.out, len(os.sched_getaffinity(0)), report)
    from nlbench.reproduce import page, tables
    from nlbench.reproduce.summarise import Call, summarise

    call = Call(wanted.mode, wanted.folder, wanted.command, time.monotonic() - begun)
    summary = summarise(chosen, needed, outcomes, call)
    tables.write(summary)
    return Done(
        summary, page.write(summary, wanted.folder), recorded.compare(summary, wanted.record)
    ), outcomes


def faults(outcomes: Mapping[str, Outcome], compared: Compared) -> list[NlbenchError]:
    """What makes the command fail, the gravest first."""
    kinds = {kind.exit_code: kind for kind in GRAVITY}
    found = [
        kinds.get(each.code, EnvironmentFault if each.code < 0 else NlbenchError)(
            f"FAILED: {each.job.name} (exit code {each.code}): {each.fault}"
        )
        for each in outcomes.values()
        if each.code
    ]
    if compared.changed:
        lines = (
            f"  {now.document} {now.entry}: {before.verdict} -> {now.verdict}"
            for before, now in compared.changed
        )
        found.append(GateError("\n".join(["verdicts that changed since they were recorded:", *lines])))
    return sorted(found, key=lambda error: GRAVITY.index(type(error)))
