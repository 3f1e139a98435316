"""Ctrl-C or SIGTERM during a run: asked once, it stops between chunks with everything saved; asked twice, at once.

The signal is only noted, because an exception raised inside a callback of jax (while compiling, say) is lost.
"""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

SIGNALS = (signal.SIGINT, signal.SIGTERM)
log = logging.getLogger("nlbench")


@contextmanager
def stop_requests() -> Iterator[Callable[[], bool]]:
    """A function that says whether SIGINT or SIGTERM has come; a second one raises KeyboardInterrupt.

    One that is ignored, as SIGINT is in the background jobs of a script, stays so.
    """
    asked: list[int] = []

    def note(number: int, frame: Any) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)
        log.warning("stopping once the blocks in flight are saved; Ctrl-C again stops at once")

    before = {number: signal.getsignal(number) for number in SIGNALS}
    try:
        for number, handler in before.items():
            if handler is not signal.SIG_IGN:
                signal.signal(number, note)
    except ValueError:  # not the main thread, which alone receives signals
        yield lambda: False
        return
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            if handler is not None:  # None: one that was not set by Python, which cannot set it again
                signal.signal(number, handler)
