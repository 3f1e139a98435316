"""What compiling takes: now, from the cache next time, and from nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import jax

BACKEND = "/jax/core/compile/backend_compile_duration"
RETRIEVAL = "/jax/compilation_cache/cache_retrieval_time_sec"
SAVED = "/jax/compilation_cache/compile_time_saved_sec"
LOADING = 0.05  # of the time to compile, where it is not known what loading takes


class Compilation(NamedTuple):
    """Seconds to trace a program, to compile it, and to load it from the cache, into which this process has put it."""

    trace: float
    compile: float
    load: float

    @property
    def again(self) -> float:
        """In the next process, which finds the program in the cache."""
        return self.trace + self.load


class Heard(NamedTuple):
    """Seconds that jax reported, by event."""

    seconds: Counter[str]

    def compilation(self, seconds: float) -> Compilation:
        """What was heard while one program was made in so many seconds."""
        backend, retrieval = self.seconds[BACKEND], self.seconds[RETRIEVAL]
        trace = max(0.0, seconds - backend)
        if retrieval:
            return Compilation(trace, max(backend, self.seconds[SAVED] + retrieval), backend)
        return Compilation(trace, backend, LOADING * backend)


@contextmanager
def listening() -> Iterator[Heard]:
    """Hear what jax reports of its compilations."""
    heard = Heard(Counter())

    def note(event: str, duration_secs: float, **_: Any) -> None:
        heard.seconds[event] += duration_secs  # type: ignore[assignment]

    jax.monitoring.register_event_duration_secs_listener(note)
    try:
        yield heard
    finally:
        jax.monitoring.unregister_event_duration_listener(note)
