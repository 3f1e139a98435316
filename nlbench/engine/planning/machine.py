"""This machine and this process: how fast Python runs, memory in use and free."""

from __future__ import annotations

import contextlib
import ctypes
import os
import time
from collections.abc import Iterator
from pathlib import Path

REFERENCE = 0.0125  # seconds that `_work` takes on the machine on which constants of time were measured
ROUNDS = 5
CGROUP = Path("/sys/fs/cgroup")
GROUPS = Path("/proc/self/cgroup")


def slowness() -> float:
    """Processor time of work in Python here, relative to the machine on which constants of time were measured."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        _work()
        times.append(time.process_time() - begun)
    return sorted(times)[ROUNDS // 2] / REFERENCE


def _work() -> int:
    return sum({i: i * i}[i] for i in range(100_000))


def resident() -> int:
    """Bytes of memory that this process holds, after what is free in it went back to the system."""
    with contextlib.suppress(OSError, AttributeError):  # a C library that does it by itself, or never
        ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def free_memory() -> int:
    """Bytes that a process can still take: of the machine, and of the control group if that has a limit."""
    lines = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
    free = int(lines["MemAvailable"].split()[0]) * 1024
    return min([free, *_free_of_groups()])


def _free_of_groups() -> Iterator[int]:
    """What the control groups of this process leave; files that the kernel only keeps in memory count as free."""
    with contextlib.suppress(OSError, ValueError, StopIteration):
        own = next(line for line in GROUPS.read_text().splitlines() if line.startswith("0::"))
        inside = CGROUP / own.removeprefix("0::").lstrip("/")
        for group in (inside, *inside.parents):
            if group.is_relative_to(CGROUP):
                with contextlib.suppress(OSError, ValueError, KeyError):  # one without a limit says "max"
                    limit = int((group / "memory.max").read_text())
                    said = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
                    used = int((group / "memory.current").read_text()) - int(said["inactive_file"])
                    yield limit - used
