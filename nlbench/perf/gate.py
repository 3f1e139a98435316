"""The gate: batches of rounds until each workload is decided, a regression only when a second batch confirms it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from nlbench.perf.baseline import Baseline, Entry
from nlbench.perf.counts import risen
from nlbench.perf.verdict import SLOWER, UNDECIDED, Change, Estimate, change, estimate

ROUNDS = 15
MOST_ROUNDS = 120  # of a batch
RECORDED_BAND = 0.01  # that a baseline should have: it enters every later comparison
RECORDED_ROUNDS = 480  # at most, for that: it is recorded once
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


def measured(rounds: Rounds, names: Sequence[str], wanted: float = math.inf) -> dict[str, Estimate]:
    """Estimates whose bands are at most `wanted`, if the limit of rounds allows."""
    return _batch(rounds, names, lambda _, now: now.band > wanted, RECORDED_ROUNDS)


def disturbed(recorded: Mapping[str, Estimate]) -> list[str]:
    """Workloads whose bands stayed wider than a baseline's should be: what disturbed them may have moved them, too."""
    return [name for name, each in recorded.items() if each.band > RECORDED_BAND]


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
    suspects = [name for name in known if _change(first[name], baseline, name).suspect(budget)]
    second = _decided(rounds, suspects, baseline, budget)
    single = measured(rounds, new)
    found = []
    for name in counts:
        if name in new:
            found.append(Finding(name, single[name], None, None, NEW, {}))
            continue
        entry = baseline.entries[name]
        now = second.get(name, first[name])
        changed = _change(now, baseline, name)
        verdict = changed.verdict(budget)
        if name in second:
            # At the limit of rounds two estimates beyond the budget count, though their bands reach below it.
            verdict = SLOWER if changed.suspect(budget) else UNDECIDED
        more = risen(counts[name], entry.counts) if same_compiler else {}
        if more and verdict != SLOWER:
            verdict = COUNTS
        found.append(Finding(name, now, entry, changed, verdict, more))
    return found


def _decided(rounds: Rounds, names: Sequence[str], baseline: Baseline, budget: float) -> dict[str, Estimate]:
    """A batch until each workload is decided, if the limit of rounds allows."""
    return _batch(rounds, names, lambda name, now: _change(now, baseline, name).verdict(budget) == UNDECIDED)


def _batch(
    rounds: Rounds,
    names: Sequence[str],
    unsettled: Callable[[str, Estimate], bool],
    most: int = MOST_ROUNDS,
) -> dict[str, Estimate]:
    """Estimates from as many rounds as each workload needs, `most` at most."""
    seconds: dict[str, np.ndarray] = {}
    estimates: dict[str, Estimate] = {}
    left = list(names)
    while left:
        for name, more in rounds(left, ROUNDS).items():
            seconds[name] = np.concatenate([seconds[name], more]) if name in seconds else more
            estimates[name] = estimate(seconds[name])
        left = [name for name in left if len(seconds[name]) < most and unsettled(name, estimates[name])]
    return estimates


def _change(now: Estimate, baseline: Baseline, name: str) -> Change:
    entry = baseline.entries[name]
    return change(now, entry.log_ratio, entry.band)
