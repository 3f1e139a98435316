"""SIGTERM does what Ctrl-C does: the engine finishes the block in flight and saves."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def terminated_like_interrupted() -> Iterator[None]:
    """Forward SIGTERM to the handler that SIGINT has at that moment; where SIGINT is ignored, as in the background jobs
    of a script, to the usual one."""

    def forward(number: int, frame: Any) -> None:
        handler = signal.getsignal(signal.SIGINT)
        (handler if callable(handler) else signal.default_int_handler)(number, frame)

    try:
        before = signal.signal(signal.SIGTERM, forward)
    except ValueError:  # not the main thread, which alone receives signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
