"""Claim: when memory runs out a run goes on with less at a time, to the same bytes; or says so with all saved."""

from __future__ import annotations

import logging
import threading
import time

import jax
import pytest

import nlbench as nb
from nlbench.engine import driver
from nlbench.errors import EnvironmentFault
from nlbench.results.folder import RunFolder
from nlbench.statistics.totals import Totals
from tests.faults.quick import small
from tests.small_runs import table_bytes

pytestmark = pytest.mark.usefixtures("quick")
OURS = MemoryError("Unable to allocate 1.2 GiB for an array")
NO_ROOM_FOR_A_STACK = RuntimeError("can't start new thread")
XLAS = jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 1288490188 bytes.")


class Scarce:
    """An executable that computes while no more than `most` calls of it are under way, or if `free` of a block."""

    def __init__(self, executable, most, error, free=lambda block: False):
        self.executable, self.most, self.error, self.free = executable, most, error, free
        self.lock, self.now, self.refused = threading.Lock(), 0, 0

    def __call__(self, seed, chunk):
        with self.lock:
            self.now += 1
            too_many = self.now > self.most and not self.free(int(chunk.lanes.low[0, 0]) // 64)
            self.refused += too_many
        try:
            if too_many:
                raise self.error
            time.sleep(0.02)
            return self.executable(seed, chunk)
        finally:
            with self.lock:
                self.now -= 1


@pytest.fixture
def scarce(program, monkeypatch):
    def made(*arguments):
        executable = Scarce(program.executables[0], *arguments)
        found = program._replace(executables=(executable,))
        monkeypatch.setattr(driver, "compile_chunks", lambda problem, seed: found)
        return executable

    return made


@pytest.mark.parametrize("error", [OURS, XLAS, NO_ROOM_FOR_A_STACK], ids=["numpy", "xla", "threads"])
def test_less_at_a_time_gives_the_same_bytes(undisturbed, scarce, tmp_path, caplog, error):
    memory = scarce(1, error)
    with caplog.at_level(logging.WARNING, logger="nlbench"):
        results = nb.run(small(engine={"chunk": 4, "threads": 3}), tmp_path)
    assert memory.refused
    assert "out of memory; going on with at most 2 blocks a call" in caplog.text
    assert table_bytes(results.path) == table_bytes(undisturbed)


@pytest.mark.parametrize("error", [OURS, XLAS], ids=["numpy", "xla"])
def test_where_a_single_block_is_too_much_what_is_done_is_saved(
    undisturbed, scarce, program, tmp_path, monkeypatch, error
):
    scarce(0, error, lambda block: block < 5)
    with pytest.raises(EnvironmentFault, match=r"out of memory: .*What needs less") as caught:
        nb.run(small(), tmp_path)
    assert caught.value.exit_code == 5
    folder = RunFolder(tmp_path / "small" / undisturbed.name)
    arrays, _ = folder.load_checkpoint()
    assert arrays["counters"][0] == 5
    seen = []
    monkeypatch.setattr(driver, "compile_chunks", lambda problem, seed: program)
    resumed = nb.run(small(), tmp_path, progress=lambda done, total: seen.append(done))
    assert seen[0] == 5 * 64
    assert table_bytes(resumed.path) == table_bytes(undisturbed)


def test_sums_that_were_added_by_half_are_not_kept(undisturbed, tmp_path, monkeypatch):
    """Memory that runs out between the sums of the groups and the errors kept of the runs."""
    add_runs, failures = Totals._add_runs, iter([OURS])

    def fails_once(totals, runs):
        if totals.blocks == 6 and (error := next(failures, None)):
            raise error
        add_runs(totals, runs)

    monkeypatch.setattr(Totals, "_add_runs", fails_once)
    assert table_bytes(nb.run(small(), tmp_path).path) == table_bytes(undisturbed)
    assert next(failures, None) is None


def test_another_error_is_raised_as_it_is_and_what_is_done_is_saved(undisturbed, scarce, tmp_path):
    scarce(0, ZeroDivisionError("by design"), lambda block: block < 5)
    with pytest.raises(ZeroDivisionError, match="by design"):
        nb.run(small(), tmp_path)
    arrays, _ = RunFolder(tmp_path / "small" / undisturbed.name).load_checkpoint()
    assert arrays["counters"][0] == 5


def test_sums_that_wait_do_not_keep_the_arrays_of_the_whole_capacity(program):
    assert all(value.base is None for value in program.sums(0, 1, 64).values())
