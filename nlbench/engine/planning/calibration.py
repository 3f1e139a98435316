"""How fast blocks are computed here: the run's own loop, for a second or so."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, NamedTuple

from nlbench.engine.compiled import CAPACITY
from nlbench.engine.workers import Threads, in_order
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled

LONG_ENOUGH = 0.8  # seconds of a pass that counts
AIM = 1.6  # seconds that a pass is made for, of which the last counts
MOST_GROWTH = 16
CALLS_OF_EACH = 8  # so that a thread that ends early waits for a sixteenth of the pass at most, on average


class Calibration(NamedTuple):
    """The first blocks' totals; seconds for each block with all threads at work and the sums added beside them; and the
    share of the processor's time that these threads got, 1 on an idle machine."""

    totals: Totals
    seconds_per_block: float
    share: float


def calibrate(compiled: Compiled, threads: int) -> Calibration:
    """Passes over more and more blocks until one takes long enough; the earlier ones warm up.

    A pass of one block a thread that takes long enough is the first and last, so that dear experiments are not computed
    twice: what is warmed up by it takes milliseconds.
    """
    totals, count = Totals(compiled.problem.layout), threads
    while True:
        begun, worked = time.perf_counter(), time.process_time()
        _pass(compiled, totals, count, threads)
        seconds, worked = time.perf_counter() - begun, time.process_time() - worked
        if seconds >= LONG_ENOUGH:
            return Calibration(totals, seconds / count, min(1.0, worked / (seconds * threads)))
        growth = AIM / max(seconds, 1e-3)
        count = max(count + 1, int(count * min(MOST_GROWTH, growth)))


def extend(compiled: Compiled, totals: Totals, blocks: int, threads: int) -> None:
    """Compute what the totals lack of so many blocks."""
    if totals.blocks < blocks:
        _pass(compiled, totals, blocks - totals.blocks, threads)


def _pass(compiled: Compiled, totals: Totals, count: int, threads: int) -> None:
    first = totals.blocks
    last = first + count
    chunk = max(1, min(CAPACITY, count // (CALLS_OF_EACH * threads)))
    with Threads(compiled, last * compiled.problem.block, threads) as workers:
        for begin, sums in in_order(workers, first, last, chunk, lambda: False):
            totals.add(begin, sums)
