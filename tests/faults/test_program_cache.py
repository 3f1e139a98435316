"""Claim: a compiled program is kept whole or not at all, and one that is damaged is compiled anew."""

from __future__ import annotations

import logging
import os

import pytest
from jax._src.lru_cache import LRUCache

from nlbench.engine.program_cache import _get, _put
from tests.faults.quick import FailingDisk
from tests.small_runs import python

COMPILE = """
import sys
import nlbench as nb
from nlbench.engine.program_cache import use_cache
nb.configure()
use_cache()
import jax
print(jax.jit(lambda x: jax.numpy.sin(x) + 1)(1.0))
"""


def test_what_is_put_is_got_back(tmp_path):
    cache = LRUCache(str(tmp_path), max_size=-1)
    assert _get(cache, "key") is None
    _put(cache, "key", b"program")
    assert _get(cache, "key") == b"program"


def test_a_full_disk_leaves_no_part_of_it(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "fsync", FailingDisk(0))
    _put(LRUCache(str(tmp_path), max_size=-1), "key", b"program")
    assert not list(tmp_path.iterdir())


def test_a_damaged_one_is_removed_and_said(tmp_path, caplog):
    cache = LRUCache(str(tmp_path), max_size=-1)
    _put(cache, "key", b"program")
    (path,) = tmp_path.iterdir()
    for data in (path.read_bytes()[:-1], b"", path.read_bytes()[:-1] + b"M"):
        path.write_bytes(data)
        with caplog.at_level(logging.WARNING, logger="nlbench"):
            assert _get(cache, "key") is None
        assert str(path) in caplog.text
        assert not path.exists()


@pytest.mark.parametrize(
    ("home", "said"),
    [
        (None, "no folder for compiled programs: set NLBENCH_CACHE"),
        ("/dev/null", "compiled programs are not kept"),
    ],
)
def test_where_nothing_can_be_kept_that_is_said_and_no_more(home, said):
    line = f"""
import os, pathlib
home = {home!r}
for name in ("NLBENCH_CACHE", "XDG_CACHE_HOME"):
    os.environ.pop(name, None)
def of_nobody():
    if home is None:
        raise RuntimeError("Could not determine home directory.")
    return pathlib.Path(home)
pathlib.Path.home = of_nobody
"""
    done = python(line + COMPILE)
    assert done.returncode == 0, done.stderr
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_jax_keeps_its_programs_this_way_and_compiles_damaged_ones_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("NLBENCH_CACHE", str(tmp_path))
    first = python(COMPILE)
    assert first.returncode == 0, first.stderr
    kept = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert kept
    assert {path.suffix for path in kept} == {".program"}
    for path, data in kept.items():
        path.write_bytes(data[: len(data) // 2])
    again = python(COMPILE)
    assert again.returncode == 0
    assert again.stdout == first.stdout
    assert again.stderr.count("it is compiled anew") == len(kept)
    assert {path.name for path in tmp_path.iterdir()} == {path.name for path in kept}
