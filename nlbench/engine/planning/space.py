"""Refuses a run for which memory or disk do not suffice, before it computes anything."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from nlbench.engine.planning import machine, sizes
from nlbench.engine.planning.memory import memory
from nlbench.errors import EnvironmentFault
from nlbench.results import atomic

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled
    from nlbench.statistics.totals import Totals

FILES = 3  # a checkpoint, the one that replaces it, and at most as much in tables of runs


def require(compiled: Compiled, totals: Totals, runs: int, threads: int, folder: Path) -> None:
    """Raises `EnvironmentFault` that says what is short, how much is needed and how much is free."""
    layout = totals.layout
    state = sizes.most_state(totals, compiled, runs)
    values = min(runs, layout.keep_runs) * len(layout.filters) * len(layout.reports)
    more = memory(compiled, compiled.problem, state, values, threads, process=0)
    short = [
        f"{what}: needs about {_size(wanted)}, free {_size(free)}"
        for what, wanted, free in (
            ("memory", sum(more.values()), machine.free_memory()),
            (f"disk of {folder}", FILES * state, atomic.free_disk(folder)),
        )
        if free is not None and wanted > free
    ]
    if short:
        raise EnvironmentFault(
            f"not begun, {'; '.join(short)}. Fewer monte_carlo.keep_runs need less; --yes begins all the same."
        )


def _size(count: int) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"
