"""Signals: SIGTERM does what Ctrl-C does, and during a run the second of either ends the process at once."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING

from nlbench.errors import Interrupted

if TYPE_CHECKING:
    import socket

INTERRUPTED = "interrupted; the same command goes on from what was saved"
SECONDS_TO_UNWIND = 0.3


@contextmanager
def heeded() -> Iterator[None]:
    """Have SIGINT and SIGTERM raise KeyboardInterrupt, or end the process while a module is imported.

    A handler that SIGINT gets meanwhile gets both. Where SIGINT is ignored, as in the background jobs of a script, it
    stays so.
    """

    def forward(number: int, frame: FrameType | None) -> None:
        handler = signal.getsignal(signal.SIGINT)
        (handler if callable(handler) else _interrupt)(number, frame)

    earlier = signal.getsignal(signal.SIGINT)
    try:
        before = signal.signal(signal.SIGTERM, forward)
    except ValueError:  # not the main thread, which alone receives signals
        yield
        return
    if earlier is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
        signal.signal(signal.SIGINT, earlier)


def _interrupt(number: int, frame: FrameType | None) -> None:
    """An extension module crashes or makes another error of what is raised while it is imported; nothing is lost where
    the process ends instead."""
    if any(each.f_code.co_filename.startswith("<frozen importlib") for each in _outwards(frame)):
        print(INTERRUPTED, file=sys.stderr, flush=True)
        os._exit(Interrupted.exit_code)
    raise KeyboardInterrupt


def _outwards(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


@contextmanager
def ended_by_a_second() -> Iterator[None]:
    """End the process soon after a second signal, even while XLA compiles, which no handler in Python interrupts.

    A thread reads what the interpreter writes when a signal comes. Nothing is lost by this: files appear whole or not
    at all, and the kernel releases the lock.
    """
    import socket

    reader, writer = socket.socketpair()
    writer.setblocking(False)
    try:
        before = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    except ValueError:  # not the main thread
        yield
        return
    unwound = threading.Event()
    threading.Thread(target=_end_at_second, args=(reader, unwound), daemon=True).start()
    try:
        yield
    finally:
        unwound.set()
        signal.set_wakeup_fd(before)
        writer.close()


def _end_at_second(reader: socket.socket, unwound: threading.Event) -> None:
    """Wait for two signals, or for the other end to be closed. Who could unwind meanwhile has said why it ends, and may
    still be waiting for calls under way."""
    come = 0
    while come < 2:
        numbers = reader.recv(64)
        if not numbers:
            return
        come += sum(number in (signal.SIGINT, signal.SIGTERM) for number in numbers)
    if not unwound.wait(SECONDS_TO_UNWIND):
        shown_again = "\033[?25h" if sys.stderr.isatty() else ""  # the cursor, which a progress bar hides
        print(f"{shown_again}{INTERRUPTED}", file=sys.stderr, flush=True)
    time.sleep(SECONDS_TO_UNWIND)
    os._exit(Interrupted.exit_code)
