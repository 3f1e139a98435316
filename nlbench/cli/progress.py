"""Progress of a run: a bar with the time left on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from nlbench.cli.output import duration

Progress = Callable[[int, int], None]
SECONDS_BETWEEN_LINES = 10.0


@contextmanager
def progress(quiet: bool = False) -> Iterator[Progress | None]:
    """A function (runs done, runs in all) that shows progress on stderr; None when `quiet`."""
    if quiet:
        yield None
    elif sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
        with _bar() as show:
            yield show
    else:
        yield _lines()


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("compiling", total=None)

        def show(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, description=f"{done:,} of {total:,} runs")

        yield show


def _lines() -> Progress:
    last = time.monotonic()
    start: tuple[float, int] | None = None  # when the first report came, and the runs done by then

    def show(done: int, total: int) -> None:
        nonlocal last, start
        now = time.monotonic()
        start = start or (now, done)
        if now - last < SECONDS_BETWEEN_LINES or done in (0, total):
            return
        last = now
        fresh = done - start[1]
        left = f", about {duration((now - start[0]) * (total - done) / fresh)} left" if fresh > 0 else ""
        print(f"{done:,} of {total:,} runs ({100 * done // total} %){left}", file=sys.stderr, flush=True)

    return show
