"""`nlbench verify`: whether results are undamaged, and whether their numbers come out again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlbench.cli import options, output, saved
from nlbench.errors import DamagedResults


def verify(
    where: options.Where,
    block: Annotated[
        int | None,
        typer.Option("--block", metavar="N", min=0, help="Block to compute again. Default: a random one."),
    ] = None,
    settings: options.Set = None,
    out: options.Out = Path("results"),
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """Check the results of a run.

    Every file against its checksum; one block, with the 64th of the runs that are summed with it, computed again bit
    for bit; and the tables made again from the sums. Nothing is written. Exit code 5 if anything is wrong.
    """
    folder = saved.found(where, settings, out)
    from nlbench import engine

    found = engine.verify(folder, block)
    faults = [DamagedResults("\n".join(found.faults))] if found.faults else []
    if json:
        code = DamagedResults.exit_code if faults else 0
        output.as_json({"folder": str(folder), **found._asdict(), "exit_code": code}, *faults)
    elif not found.faults:
        print(f"{folder}: sound")
        shown = [("files", f"{found.files} as they were written")]
        if found.block is not None:
            shown += [
                ("block", f"{found.block}; with its group, {found.recomputed} blocks computed again"),
                ("tables", f"{found.tables} made again from the sums"),
                ("digits", "the same to the last bit" if found.same else "others"),
            ]
        output.rows(shown)
        for each in found.remarks:
            print(f"  {each}")
        output.next_step(f"nlbench report {folder}", "draws the figures and writes the report")
    if faults:
        raise faults[0]
