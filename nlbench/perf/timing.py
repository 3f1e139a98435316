"""Times of workloads beside the reference kernel: rounds that take turns, two samples of each in a round."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

SAMPLE_SECONDS = 0.008  # a sample repeats its work until it takes about this long
Call = Callable[[int], object]  # (times): computes it so many times
Clock = Callable[[], float]


def on_one_thread() -> None:
    """Have XLA compute with one thread, if jax has not started: with more, those that find nothing to do spin a while,
    and their processor time is counted (bands of ratios were 3 to 9 % instead of 1)."""
    os.environ.setdefault("PJRT_NPROC", "1")


def clock() -> Clock:
    """Processor time of this process where the processor computes, since other processes lengthen it little; else wall
    time."""
    import jax

    return time.process_time if jax.default_backend() == "cpu" else time.perf_counter


class Timer:
    """Rounds of samples: for each workload kernel, workload, kernel, workload, so that what drifts cancels."""

    def __init__(self, kernel: Callable[[], object], calls: Mapping[str, Call], clock: Clock):
        self._clock = clock
        self._kernel, self._calls = repeated(kernel), dict(calls)
        self._repeats = {name: self._needed(call) for name, call in self._calls.items()}
        self._kernel_repeats = self._needed(self._kernel)
        self._order = np.random.default_rng(0)

    def rounds(self, names: Sequence[str], count: int) -> dict[str, np.ndarray]:
        """(count, 2, 2) seconds of each workload: per round two pairs of kernel and workload."""
        found = {name: np.empty((count, 2, 2)) for name in names}
        for number in range(count):
            for name in self._order.permutation(names):  # so that none always follows the same one
                for pair in range(2):
                    found[name][number, pair, 0] = self._seconds(self._kernel, self._kernel_repeats)
                    found[name][number, pair, 1] = self._seconds(self._calls[name], self._repeats[name])
        return found

    def _needed(self, call: Call) -> int:
        call(1)
        times = 1
        for _ in range(2):  # the first time is mostly that of calling where there is little to compute
            times = max(1, round(SAMPLE_SECONDS / max(self._seconds(call, times), 1e-6)))
        return times

    def _seconds(self, call: Call, times: int) -> float:
        call(1)  # what another program left in the caches is not this one's to pay
        begun = self._clock()
        call(times)
        return (self._clock() - begun) / times


def repeated(call: Callable[[], object]) -> Call:
    """Called as often as it is to be computed."""

    def calls(times: int) -> None:
        for _ in range(times):
            call()

    return calls
