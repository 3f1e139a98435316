"""The budget of time: a run that would take longer is stopped once that can be told, after a few seconds."""

from __future__ import annotations

import os
import re
import time
from typing import TYPE_CHECKING, Annotated

import typer

from nlbench.cli.output import duration
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.cli.progress import Progress

DEFAULT = "12h"
VARIABLE = "NLBENCH_BUDGET"
SETTLED = 3.0  # seconds of computing after which the time left is believed
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}

Budget = Annotated[
    str | None,
    typer.Option(
        "--budget",
        metavar="TIME",
        help=f"Longest run to begin without --yes: 90min, 2h, 3d. Default: ${VARIABLE} or {DEFAULT}.",
    ),
]
Yes = Annotated[bool, typer.Option("--yes", help="Begin whatever time, memory and disk it takes.")]


def seconds(text: str | None) -> float:
    """The budget in seconds: of the option, the environment, or the default. Raises `ConfigError` for another word."""
    given, source = (
        (text, "--budget") if text is not None else (os.environ.get(VARIABLE) or DEFAULT, VARIABLE)
    )
    matched = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h|d)\s*", given)
    if matched is None or not float(matched[1]):
        raise ConfigError(f"{source}: expected a time such as 90min, 2h or 3d, found {given[:40]!r}")
    return float(matched[1]) * UNITS[matched[2]]


class Guard:
    """Progress that raises `ConfigError`, once, if the time to the end is more than the budget."""

    def __init__(self, budget: float, show: Progress | None):
        self._budget, self._show = budget, show
        # Runs done before; when the first results of this call came, and the runs done then.
        self._begun: int | None = None
        self._first: tuple[float, int] | None = None
        self._decided = False

    def __call__(self, done: int, total: int) -> None:
        if self._show is not None:
            self._show(done, total)
        now = time.monotonic()
        self._begun = done if self._begun is None else self._begun
        if done == self._begun:  # workers may still start and compile
            return
        self._first = self._first or (now, done)
        elapsed, fresh = now - self._first[0], done - self._first[1]
        if self._decided or elapsed < SETTLED or not fresh:
            return
        self._decided = True
        left = elapsed / fresh * (total - done)
        if left > self._budget:
            raise ConfigError(
                f"stopped after {done:,} runs: {total:,} would take about {duration(left)} more, and the budget is "
                f"{duration(self._budget)}; choose fewer runs or a larger --budget, or say --yes"
            )
