"""The gate: batches of rounds until each workload is decided, a regression only when a second batch confirms it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nlbench.perf.baseline import Baseline, Entry
from nlbench.perf.counts import risen
from nlbench.perf.verdict import SLOWER, UNDECIDED, Change, Estimate, change, estimate

ROUNDS = 15
MOST_ROUNDS = 120  # of a batch
RECORD_ROUNDS = 45
NEW, COUNTS = "new", "counts rose"
FAILURES = (SLOWER, COUNTS)
Rounds = Callable[[Sequence[str], int], Mapping[str, np.ndarray]]


class Finding(NamedTuple):
    """What is said of a workload; change is None where the baseline has none; risen: factors of counts."""

    name: str
    now: Estimate
    entry: Entry | None
    change: Change | None
    verdict: str
    risen: dict[str, float]


def measured(rounds: Rounds, names: Sequence[str], count: int = RECORD_ROUNDS) -> dict[str, Estimate]:
    """Estimates of `count` rounds."""
    return {name: estimate(seconds) for name, seconds in rounds(names, count).items()}


def compared(
    rounds: Rounds,
    counts: Mapping[str, dict[str, float]],
    baseline: Baseline,
    budget: float,
    same_compiler: bool,
) -> list[Finding]:
    """A finding for each workload, in order. Counts are compared where the compiler is the baseline's."""
    known = [name for name in counts if name in baseline.entries]
    new = [name for name in counts if name not in baseline.entries]
    first = _decided(rounds, known, baseline, budget)
    suspects = [name for name in known if _verdict(first[name], baseline, name, budget) == SLOWER]
    second = _decided(rounds, suspects, baseline, budget)
    single = measured(rounds, new, ROUNDS)
    found = []
    for name in counts:
        if name in new:
            found.append(Finding(name, single[name], None, None, NEW, {}))
            continue
        entry = baseline.entries[name]
        now = second.get(name, first[name])
        verdict = _verdict(now, baseline, name, budget)
        if name in second and verdict != SLOWER:
            verdict = UNDECIDED  # two batches do not agree
        more = risen(counts[name], entry.counts) if same_compiler else {}
        if more and verdict != SLOWER:
            verdict = COUNTS
        found.append(Finding(name, now, entry, change(now, entry.log_ratio, entry.band), verdict, more))
    return found


def _decided(rounds: Rounds, names: Sequence[str], baseline: Baseline, budget: float) -> dict[str, Estimate]:
    """A batch: estimates from as many rounds as each workload needs to be decided, up to the limit."""
    seconds: dict[str, np.ndarray] = {}
    estimates: dict[str, Estimate] = {}
    open_names = list(names)
    while open_names:
        for name, more in rounds(open_names, ROUNDS).items():
            seconds[name] = np.concatenate([seconds[name], more]) if name in seconds else more
            estimates[name] = estimate(seconds[name])
        open_names = [
            name
            for name in open_names
            if estimates[name].rounds < MOST_ROUNDS
            and _verdict(estimates[name], baseline, name, budget) == UNDECIDED
        ]
    return estimates


def _verdict(now: Estimate, baseline: Baseline, name: str, budget: float) -> str:
    entry = baseline.entries[name]
    return change(now, entry.log_ratio, entry.band).verdict(budget)
