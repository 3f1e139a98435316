"""`nlbench reproduce`: run the figures and tables of the sources, and say which of them hold."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nlbench.cli import options, output

if TYPE_CHECKING:
    from nlbench.reproduce.driver import Outcome
    from nlbench.reproduce.jobs import Job
    from nlbench.reproduce.reproduction import Done, Wanted
    from nlbench.reproduce.summary import Summary

TITLE = output.WIDTH - 18  # columns for the title of a document; its name takes the others
STYLES = {
    "REPRODUCED": "green",
    "REPRODUCED (claims only)": "green",
    "INCONCLUSIVE AT THE SOURCE'S N": "yellow",
    "DIFFERS": "red",
    "NOT TESTABLE": "dim",
}


def reproduce(
    source: Annotated[
        str | None,
        typer.Argument(
            metavar="SOURCE",
            help="culver, schwartz, henriksen or athans; default: all.",
            show_default=False,
        ),
    ] = None,
    figure: Annotated[
        str | None, typer.Option("--figure", metavar="F", help="One figure or table: 7.18, 'table 8.1'.")
    ] = None,
    quick: Annotated[
        bool,
        typer.Option(
            "--quick/--full",
            help="At most 2,048 runs of each experiment, 320 where the reference is dear: 16 minutes on two "
            "cores, 10 where all is compiled already. Full: as many as its file says, about two hours of "
            "processor time; goes on from quick runs of the same settings.",
        ),
    ] = False,
    out: options.Out = Path("results"),
    configs: Annotated[
        Path, typer.Option("--configs", metavar="DIR", help="Folder of the experiments.")
    ] = Path("configs"),
    record: Annotated[
        bool, typer.Option("--record", help="Put these verdicts on record; otherwise compare with them.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Reproduce the figures and tables of the sources, with a verdict on each.

    Experiments that are done are not run again; one that was stopped goes on. Exit code 3 if a verdict differs from
    the one on record.
    """
    from nlbench.reproduce import recorded, reproduction

    wanted = reproduction.Wanted(source, figure, quick, out, configs)
    chosen, needed = reproduction.plan(wanted)
    print(_ahead(needed), file=sys.stderr, flush=True)
    done, outcomes = reproduction.reproduce(wanted, chosen, needed, _Progress(len(needed)))
    found = recorded.record(done.summary, wanted.record) if record else None
    faults = reproduction.faults(outcomes, done.compared)
    if record:
        faults = [each for each in faults if each.exit_code != 3]
    if json:
        output.as_json(_facts(done, faults[0].exit_code if faults else 0), *faults)
    else:
        _show(done, wanted, found)
    for each in faults[1:]:
        output.complain(str(each))
    if faults:
        raise faults[0]


def _ahead(needed: list[Job]) -> str:
    """What is to be done."""
    count = len(needed)
    runs = sum(job.runs for job in needed)
    return f"{count} experiment{'' if count == 1 else 's'}, {runs:,} runs in all; those that are done are not run again"


class _Progress:
    """A line on stderr for each experiment, as it ends."""

    def __init__(self, total: int):
        self.total, self.count = total, 0

    def __call__(self, outcome: Outcome) -> None:
        self.count += 1
        job = outcome.job
        what = "done before" if outcome.seconds is None else output.duration(outcome.seconds)
        if outcome.code:
            what = f"FAILED with exit code {outcome.code} after {what}"
        elif outcome.fault:
            what = f"{what}; {outcome.fault}"
        width = len(str(self.total))
        line = f"{self.count:{width}} of {self.total}  {job.name}, {job.runs:,} runs: {what}"
        print(line, file=sys.stderr, flush=True)


def _show(done: Done, wanted: Wanted, recorded: int | None) -> None:
    summary = done.summary
    for document in summary.documents:
        print(f"\n{output.styled(_cut(document.title, TITLE), 'bold')} ({document.name})")
        for entry in document.entries:
            verdict = output.styled(entry.verdict.ljust(30), STYLES[entry.verdict])
            print(f"  {_cut(entry.name, 14):14}  {verdict}  {_cut(entry.caption, 30)}")
    print("\nverdicts")
    counts = [[str(count), verdict] for verdict, count in summary.totals.items() if count]
    output.rows([*counts, ["", _on_record(done, recorded)]])
    print("\ntime")
    output.rows(
        [
            ["this call", output.duration(summary.seconds)],
            ["all computing", output.duration(summary.computing)],
        ]
    )
    print("\nfiles")
    output.rows([("report", str(done.page)), ("tables", f"{wanted.folder}/verdicts.csv, claims.csv")])
    output.next_step(
        f"open {done.page}", "every figure with its claims, tests and verdict; it needs no network"
    )


def _on_record(done: Done, recorded: int | None) -> str:
    """How these verdicts compare with those on record."""
    same, changed, other, unknown = done.compared
    if recorded is not None:
        return f"{recorded} put on record, of which {len(changed)} had been another"
    parts = [f"{same} as recorded"] if same else []
    parts += [f"{len(changed)} changed"] if changed else []
    parts += [f"{other} recorded of other numbers of runs"] if other else []
    parts += [f"{unknown} not on record (--record)"] if unknown else []
    return ", ".join(parts)


def _facts(done: Done, exit_code: int) -> dict[str, object]:
    summary: Summary = done.summary
    entries = [
        {
            key: getattr(entry, key)
            for key in ("document", "name", "caption", "verdict", "because", "change", "experiments")
        }
        for entry in summary.entries
    ]
    return {
        "mode": summary.mode,
        "folder": str(summary.folder),
        "report": str(done.page),
        "seconds": summary.seconds,
        "totals": summary.totals,
        "entries": entries,
        "changed": [
            {"document": now.document, "entry": now.entry, "recorded": before.verdict, "found": now.verdict}
            for before, now in done.compared.changed
        ],
        "exit_code": exit_code,
    }


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 1]}…"
