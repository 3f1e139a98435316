"""Out of memory: how it is recognised, what of the work is made smaller, and what is said when nothing helps."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

from nlbench.errors import EnvironmentFault

ADVICE = (
    "What is saved stays, and the same command goes on from there. What needs less: other programs closed, "
    "a coarser time.output, fewer report_times, fewer filters or particles in a file, a smaller "
    "monte_carlo.keep_runs (`nlbench plan CONFIG` says what a file needs)"
)
log = logging.getLogger("nlbench")


class Load(NamedTuple):
    """How many blocks a call has at most, and how many calls are under way or wait to be taken; None: as many as keep
    all workers busy."""

    chunk: int
    ahead: int | None = None

    def halved(self, error: Exception, busy: int) -> Load:
        """Half of both, after `error`, which is raised again where it is another or there is nothing left to halve.

        busy: calls that keep all workers busy.
        """
        if not ran_out(error) or self == (1, 1):
            raise error
        less = Load(max(1, self.chunk // 2), max(1, (self.ahead or busy) // 2))
        log.warning(
            "out of memory; going on with at most %d blocks a call and %d calls at a time, which changes no digit",
            *less,
        )
        return less


def ran_out(error: BaseException) -> bool:
    """Whether an error says that memory ran out: Python's, NumPy's and Arrow's own, XLA's, which has a status in its
    text, or that of a thread for whose stack there is no room."""
    said = str(error)
    return (
        isinstance(error, MemoryError)
        or (type(error).__name__ in ("JaxRuntimeError", "XlaRuntimeError") and "RESOURCE_EXHAUSTED" in said)
        or (isinstance(error, RuntimeError) and said == "can't start new thread")
    )


@contextmanager
def memory_faults() -> Iterator[None]:
    """Raise what says that memory ran out as `EnvironmentFault`."""
    try:
        yield
    except Exception as error:
        if not ran_out(error):
            raise
        raise fault(error) from error


def fault(error: BaseException) -> EnvironmentFault:
    """What to say of an error that says that memory ran out."""
    said = " ".join(str(error).removeprefix("RESOURCE_EXHAUSTED:").split())[:200]
    return EnvironmentFault(f"out of memory{f': {said}' if said else ''}. {ADVICE}")
