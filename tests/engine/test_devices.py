"""Claim: all devices of a process compute, each its own blocks."""

from __future__ import annotations

import os

from tests.small_runs import python

TWO = """
import nlbench as nb
from tests.small_runs import experiment
nb.configure()
from nlbench.engine.block import make_chunk
from nlbench.engine.compiled import CAPACITY, Compiled, compile_chunks
from nlbench.engine.problem import make
from nlbench.engine.workers import Threads
compiled = compile_chunks(make(experiment(reference=None)), 11)
chunk = make_chunk(compiled.problem, 0, 1, CAPACITY, 64)
for executable in compiled.executables:
    sums, _ = executable(compiled.seed, chunk)
    print(*sorted(str(each) for each in sums["total"].devices()))
called, plain = [], Compiled.sums
def sums(self, first_block, count, runs, device=0):
    called.append(device)
    return plain(self, first_block, count, runs, device)
Compiled.sums = sums
with Threads(compiled, 640, 1) as workers:
    [call.result() for call in [workers.submit(block, 1) for block in range(10)]]
print(workers.at_once, *sorted(set(called)))
"""


def test_each_of_two_devices_computes():
    flags = os.environ.get("XLA_FLAGS", "")
    done = python(TWO, xla_flags=f"{flags} --xla_force_host_platform_device_count=2")
    assert done.returncode == 0, done.stderr
    first, second, used = done.stdout.split("\n")[:3]
    assert first != second
    assert used == "2 0 1"
