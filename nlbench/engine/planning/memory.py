"""Bytes of memory that a run needs, from the compiled program and the sizes of what is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.engine.planning import sizes

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.problem import Problem

WAITING = 2  # results for each thread that wait to be added
COPIES = 3  # of the totals while they are saved: the copy, the file in memory, and that as bytes
ROW = 120  # of a kept run, filter and time: as a table, and as the file made of it
LIBRARIES = 220_000_000  # tables and figures: pandas, pyarrow, scipy, matplotlib


def memory(
    compiled: Compiled, problem: Problem, state: int, kept: int, threads: int, held: int, grown: int
) -> dict[str, int]:
    """Bytes by what they are for.

    state: of the totals. kept: values in the table of runs. held: by this process after it made the program, grown: by
    how much while it made it; as much is taken again when each filter is compiled alone, after totals are saved and
    tables made.
    """
    program = sizes.program(compiled)
    call = program["argument"] + program["output"] + program["temp"]
    columns = len(problem.layout.coordinates)
    return {
        "process": held,
        "calls": threads * (call + WAITING * program["output"]),
        "totals": state,
        "finishing": max(COPIES * state, (ROW + 32 * columns) * kept, grown),
        "libraries": LIBRARIES,
    }
