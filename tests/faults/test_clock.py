"""Claim: nothing but stamps depends on the clock of the wall, or on the dates of files."""

from __future__ import annotations

import ast
import itertools
import os
import time
from pathlib import Path

import pytest

import nlbench as nb
from tests.faults.quick import small
from tests.faults.test_folder_removed import Once
from tests.small_runs import table_bytes

ROOT = Path(nb.__file__).parent
# Of a lock, of a manifest, of a summary.
STAMPS = {"results/lock.py", "engine/finish.py", "reproduce/summarise.py"}
WALL = {
    "time",
    "time_ns",
    "localtime",
    "gmtime",
    "st_mtime",
    "st_mtime_ns",
    "st_ctime",
    "now",
    "today",
    "utcnow",
}


def test_the_clock_of_the_wall_is_read_for_stamps_only():
    readers = set()
    for path in ROOT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            owner = node.value if isinstance(node, ast.Attribute) and node.attr in WALL else None
            name = getattr(owner, "id", getattr(owner, "attr", ""))
            if name in ("time", "datetime", "date") or (owner is not None and node.attr.startswith("st_")):
                readers.add(str(path.relative_to(ROOT)))
    assert readers == STAMPS


@pytest.mark.usefixtures("quick")
def test_a_clock_that_jumps_and_files_from_the_future_change_nothing(undisturbed, tmp_path, monkeypatch):
    jumps = itertools.cycle([0.0, 4e9, 1.0, 2e9])
    monkeypatch.setattr(time, "time", lambda: next(jumps))
    monkeypatch.setattr(time, "time_ns", lambda: int(next(jumps) * 1e9))
    with pytest.raises(KeyboardInterrupt):
        nb.run(small(), tmp_path, progress=Once(interrupt))
    for number, path in enumerate(sorted(tmp_path.rglob("*"))):
        os.utime(path, (4e9 * (number % 2), 4e9 * (number % 2)))
    assert table_bytes(nb.run(small(), tmp_path).path) == table_bytes(undisturbed)


def interrupt():
    raise KeyboardInterrupt
