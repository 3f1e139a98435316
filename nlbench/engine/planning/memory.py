"""Bytes of memory that a run needs, from the compiled program and the sizes of what is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.engine.planning import sizes

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.problem import Problem

WAITING = 2  # results for each thread that wait to be added
# What tracing and loading a program leave for each byte of it that stays: 1.1 to 1.8 on experiments of this repository.
PIECES = 1.75
COPIES = 3  # of the totals while they are saved: the copy, the file in memory, and that as bytes
ROW = 120  # of a kept run, filter and time: as a table, and as the file made of it
LIBRARIES = 220_000_000  # tables and figures: pandas, pyarrow, scipy, matplotlib


def process(before: int, after: int) -> int:
    """Bytes held by a process that finds the program in the cache, from those in use before and after it was made here,
    where compiling may have left much more in pieces."""
    return round(before + PIECES * (after - before))


def memory(
    compiled: Compiled, problem: Problem, state: int, kept: int, threads: int, process: int
) -> dict[str, int]:
    """Bytes by what they are for.

    state: of the totals. kept: values in the table of runs. process: held by a process that has made the program.
    """
    program = sizes.program(compiled)
    call = program["argument"] + program["output"] + program["temp"]
    columns = len(problem.layout.coordinates)
    return {
        "process": process,
        "calls": threads * (call + WAITING * program["output"]),
        "totals": state,
        "finishing": max(COPIES * state, (ROW + 32 * columns) * kept),
        "libraries": LIBRARIES,
    }
