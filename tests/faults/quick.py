"""Runs that take a fraction of a second, for tests that need many: compiled once, and costs are not measured."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from nlbench.engine import driver, finish
from nlbench.engine.compiled import Compiled, compile_chunks
from nlbench.engine.problem import make
from tests.small_runs import experiment

FULL, BROKEN, READ_ONLY = errno.ENOSPC, errno.EIO, errno.EROFS
RUNS = 1000  # 15 whole blocks and a part


def small(**changes: Any) -> Any:
    """Two filters, no reference, one block a call."""
    plain = {"reference": None, "engine": {"chunk": 1, "threads": 2}}
    return experiment(**{**plain, **changes})


def compiled() -> Compiled:
    """The program of `small()`."""
    return compile_chunks(make(small()), 11)


def made_quick(patch: pytest.MonkeyPatch, program: Compiled) -> None:
    """Have runs of `small()` take the program given, and say that filters cost nothing."""
    patch.setattr(driver, "make", lambda experiment, own: program.problem)
    patch.setattr(driver, "compile_chunks", lambda problem, seed: program)
    patch.setattr(finish, "cost_table", lambda *given: pd.DataFrame({"filter": ["any"]}))


class FailingDisk:
    """In place of `os.fsync`, through which every file of a run goes: its `fail`-th call raises an error."""

    def __init__(self, fail: int | None = None, number: int = FULL, error: BaseException | None = None):
        self.fail, self.calls, self._fsync = fail, 0, os.fsync
        self.error = error or OSError(number, os.strerror(number))

    def __call__(self, descriptor: int) -> None:
        self.calls += 1
        if self.calls - 1 == self.fail:
            raise self.error
        self._fsync(descriptor)


def left_over(folder: Path) -> list[Path]:
    """Files that were being written."""
    return [path for path in folder.rglob(".*") if path.name != ".lock"]
