"""Who computes blocks: calls that run at the same time, whose sums are taken in the order of the blocks."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from queue import SimpleQueue
from types import TracebackType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, runtime_checkable

import jax

from nlbench.engine.compiled import CAPACITY

if TYPE_CHECKING:
    from nlbench.engine.compiled import Compiled

SECONDS_OF_A_CALL = 1.0
CALLS_OF_A_DEVICE = 2


class Part(NamedTuple):
    """The sums of the blocks of one call, stacked along a leading axis, and the seconds that it took."""

    sums: dict[str, Any]
    seconds: float


@runtime_checkable
class Workers(Protocol):
    """Several calls at a time; `at_once` says how many make all of them busy, which may change."""

    at_once: int

    def submit(self, first: int, count: int) -> Future[Part]:
        """Begin to compute blocks first ... first + count - 1."""


class Threads:
    """Threads of this process, which call the same compiled program on different blocks, on all devices in turn.

    The cores are one device, called by as many threads as asked for; an accelerator is one each, and is called by two:
    while it computes for one, the other fetches.
    """

    def __init__(self, compiled: Compiled, runs: int, threads: int):
        devices = len(compiled.executables)
        self.at_once = (
            max(threads, devices) if jax.default_backend() == "cpu" else CALLS_OF_A_DEVICE * devices
        )
        self._compiled, self._runs = compiled, runs
        self._free: SimpleQueue[int] = SimpleQueue()
        for call in range(self.at_once):
            self._free.put(call % devices)
        self._pool = ThreadPoolExecutor(self.at_once)

    def submit(self, first: int, count: int) -> Future[Part]:
        return self._pool.submit(self._timed, first, count)

    def _timed(self, first: int, count: int) -> Part:
        device = self._free.get()
        try:
            begun = time.perf_counter()
            sums = self._compiled.sums(first, count, self._runs, device)
            return Part(sums, time.perf_counter() - begun)
        finally:
            self._free.put(device)

    def __enter__(self) -> Threads:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # Who has no patience left does not wait for the calls under way.
        self._pool.shutdown(wait=not isinstance(error, KeyboardInterrupt), cancel_futures=True)


def in_order(
    workers: Workers,
    first: int,
    last: int,
    chunk: int,
    stopped: Callable[[], bool],
    ahead: int | None = None,
) -> Generator[tuple[int, dict[str, Any]], None, None]:
    """Sums of blocks first ... last - 1 in order, computed by workers that run ahead; ends early when stopped.

    A call takes as many blocks as take about `SECONDS_OF_A_CALL`, so that a run stops soon after it is asked to.
    ahead: calls that are under way or wait to be taken, twice `at_once` unless said. When a call fails, or who takes
    the sums does, the error is raised once no call is under way: their memory is free again.
    """
    start, size = first, 1
    pending: deque[tuple[int, int, Future[Part]]] = deque()
    try:
        while True:
            while len(pending) < (ahead or busy(workers)) and not stopped() and start < last:
                most = min(chunk, CAPACITY, max(1, -(-(last - first) // (4 * workers.at_once))))
                count = min(size, most, last - start)
                pending.append((start, count, workers.submit(start, count)))
                start += count
            if not pending:
                return
            begin, count, future = pending.popleft()
            sums, seconds = future.result()
            del future  # it holds the sums
            size = max(1, int(count * SECONDS_OF_A_CALL / max(seconds, 1e-9)))
            yield begin, sums
            del sums
    except (Exception, GeneratorExit):
        wait([each for *_, each in pending if not each.cancel()])
        raise


def busy(workers: Workers) -> int:
    """How many calls, under way or waiting to be taken, keep all workers busy."""
    return 2 * workers.at_once
