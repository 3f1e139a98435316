"""What runs in a worker process of a cluster: the program, made once from the experiment, and calls of it.

Digits do not depend on who computes a block as long as everything that decides them is the same; a worker on which
anything differs refuses, so that nothing is ever mixed.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import signal
import threading
import time
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.errors import EnvironmentFault

if TYPE_CHECKING:
    from nlbench.config.schema import PluginSpec
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.workers import Part

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
LARGEST_KEPT = 32 << 20  # bytes, the largest value that glibc takes
PROGRAMS = 4  # kept in a worker process, for a cluster that is used again
_one_builds = threading.Lock()


class Task(NamedTuple):
    """What all calls of a run share: the resolved experiment (YAML), its number of runs, what decides digits where the
    results are merged (`resume.numerics`), and the plug-ins that the user has allowed there, with their source."""

    experiment: str
    runs: int
    numerics: tuple[tuple[str, str], ...]
    plugins: tuple[PluginSpec, ...] = ()


def compute(task: Task, first: int, count: int) -> Part:
    """Sums of blocks first ... first + count - 1. Raises `EnvironmentFault` where digits could differ."""
    with _one_builds:
        compiled = _compiled(task.experiment, task.plugins)
    _refuse_differences(compiled, dict(task.numerics))
    from nlbench.engine.workers import Part

    begun = time.perf_counter()
    sums = compiled.sums(first, count, task.runs)
    return Part(sums, time.perf_counter() - begun)


def settle() -> None:
    """Fit memory and threads of the process to what a worker does, before jax starts in it.

    dask's workers start with MALLOC_TRIM_THRESHOLD_ at 64 KiB, which also keeps the C library from learning what to
    keep: the arrays of every call were fetched anew from the kernel. And XLA starts as many threads as there are cores
    in every process; those of several workers wait for each other. Two workers on two cores were no faster than one.
    """
    with contextlib.suppress(OSError, AttributeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_THRESHOLD, LARGEST_KEPT)
        mallopt(M_TRIM_THRESHOLD, 2 * LARGEST_KEPT)
    with contextlib.suppress(ImportError, ValueError):  # not in a worker
        from distributed import get_worker

        os.environ.setdefault("PJRT_NPROC", str(get_worker().state.nthreads))


@lru_cache(PROGRAMS)
def _compiled(text: str, allowed: tuple[PluginSpec, ...]) -> Compiled:
    from nlbench import config, plugins, runtime
    from nlbench.config.document import compose

    settle()
    plugins.restore(allowed)
    experiment = config.from_dict(compose(text, "the experiment").data)
    runtime.configure(precision=experiment.engine.precision)
    from nlbench.engine.compiled import compile_chunks
    from nlbench.engine.problem import make

    return compile_chunks(make(experiment), experiment.monte_carlo.seed)


def _refuse_differences(compiled: Compiled, expected: dict[str, str]) -> None:
    import socket

    from nlbench.engine.resume import numerics

    mine = numerics(compiled)
    differing = [
        f"{name}: {mine.get(name)} there, {expected.get(name)} here"
        for name in sorted({*mine, *expected})
        if mine.get(name) != expected.get(name)
    ]
    if differing:
        raise EnvironmentFault(
            f"the worker on {socket.gethostname()} has other software or hardware ({'; '.join(differing)}), which "
            "would change digits: use workers of one kind and the same environment as here"
        )


def dask_setup(worker: Any) -> None:
    """As a preload of local workers: a Ctrl-C in the terminal is the business of the run alone, which then stops in
    order. And what takes seconds to load is loaded by all workers at once, while the client compiles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    importlib.import_module("nlbench.engine.problem")
