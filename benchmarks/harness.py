"""Times rows against each other: interleaved rounds in one process, medians, ratios within a round.

What is measured is the processor time of the process, which runs on one core: other processes there lengthen
it little, where they would lengthen a wall clock's time in full. `share` says how much of the core it had.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.rows import Row

SAMPLE_SECONDS = 0.01  # a sample repeats its call until it takes about this long


class Timing(NamedTuple):
    """A row's times: nanoseconds per trajectory x RK4 step, and its ratio to the base row of the same round.

    low, high: the middle 80 % of the rounds' ratios. share: processor time over wall time. samples: nanoseconds in
    each round.
    """

    name: str
    nanoseconds: float
    ratio: float
    low: float
    high: float
    share: float
    rounds: int
    compile_seconds: float
    samples: tuple[float, ...]

    def over(self, other: Timing) -> float:
        """The median of the ratios, within rounds, to another row timed with it."""
        return float(np.median(np.divide(self.samples, other.samples)))


def interleave(rows: Sequence[Row], rounds: int) -> list[Timing]:
    """Timings of the rows, the first being the base.

    The base runs twice a round; its second time is the last timing, "A/A": how far from 1 noise alone gets.
    """
    arms = [*rows, rows[0]._replace(name=f"A/A: {rows[0].name} again")]
    repeats = [max(1, round(SAMPLE_SECONDS / _seconds(row, 1)[1])) for row in arms]
    samples = np.empty((rounds, len(arms), 2))  # processor and wall time of one call
    order = np.random.default_rng(0)
    for r in range(rounds):
        for arm in order.permutation(len(arms)):  # so that no row always follows the same one
            arms[arm].call()  # what the row before left in the caches is not this row's to pay
            samples[r, arm] = _seconds(arms[arm], repeats[arm])
    work = np.array([row.work for row in arms])
    nanoseconds = samples[:, :, 0] / work * 1e9
    ratios = nanoseconds / nanoseconds[:, :1]
    return [
        Timing(
            name=row.name,
            nanoseconds=float(np.median(nanoseconds[:, i])),
            ratio=float(np.median(ratios[:, i])),
            low=float(np.quantile(ratios[:, i], 0.1)),
            high=float(np.quantile(ratios[:, i], 0.9)),
            share=float(np.median(samples[:, i, 0] / samples[:, i, 1])),
            rounds=rounds,
            compile_seconds=row.compile_seconds,
            samples=tuple(nanoseconds[:, i].tolist()),
        )
        for i, row in enumerate(arms)
    ]


def _seconds(row: Row, repeats: int) -> tuple[float, float]:
    """Processor and wall time of one call."""
    wall, processor = time.perf_counter(), time.process_time()
    for _ in range(repeats):
        row.call()
    return (time.process_time() - processor) / repeats, (time.perf_counter() - wall) / repeats
