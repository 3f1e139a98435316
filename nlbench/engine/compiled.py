"""The compiled block computation, made once and called from every thread."""

from __future__ import annotations

import hashlib
import threading
import time
from collections import OrderedDict
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from nlbench.engine.block import View, chunk_sums, make_chunk, words
from nlbench.engine.program_cache import use_cache
from nlbench.statistics.share import ALL, Share

if TYPE_CHECKING:
    from nlbench.engine.problem import Problem

CAPACITY = (
    64  # blocks of a call at most; one size for all, since XLA may compile another one to other last bits
)
PROGRAMS = 4  # kept in a process
_kept: OrderedDict[str, Compiled] = OrderedDict()  # the one used last is the last
_one_compiles = threading.Lock()


class Compiled(NamedTuple):
    """A compiled `chunk_sums` of at most `CAPACITY` blocks a call, once for each device of the process; `program`
    identifies what was compiled."""

    executables: tuple[Any, ...]
    problem: Problem
    seed: tuple[Any, Any]
    seconds: float
    program: str
    share: Share = ALL

    def sums(self, first_block: int, count: int, runs: int, device: int = 0) -> dict[str, np.ndarray]:
        """Sums of blocks first_block ... first_block + count - 1 of the share, computed on a device, on the host."""
        chunk = make_chunk(self.problem, first_block, count, CAPACITY, runs, share=self.share)
        sums, _ = self.executables[device](self.seed, chunk)
        # Copied, so that sums that wait to be added do not keep arrays of the full capacity.
        return {name: np.asarray(value)[:count].copy() for name, value in sums.items()}

    def view(self, trajectory: int) -> View:
        """One trajectory in full, computed with its block by the same executable."""
        block, lane = divmod(trajectory, self.problem.block)
        chunk = make_chunk(self.problem, block, 1, CAPACITY, trajectory + 1, (0, lane))
        return jax.tree.map(np.asarray, self.executables[0](self.seed, chunk)[1])


def compile_chunks(problem: Problem, seed: int) -> Compiled:
    """The program of a problem: the one that this process made before, if it did, or else a new one.

    So who runs, tops up, replays and verifies an experiment in one process, with one seed or many, waits once.
    """
    name = problem.same
    if name is None:
        return compile_anew(problem, seed)
    begun = time.perf_counter()
    with _one_compiles:
        if name in _kept:
            _kept.move_to_end(name)
            return _kept[name]._replace(seed=words(seed), seconds=time.perf_counter() - begun)
        made = _kept[name] = compile_anew(problem, seed)
        if len(_kept) > PROGRAMS:
            _kept.popitem(last=False)
    return made


def forget_programs() -> None:
    """Let the next run compile anew whatever this process made before."""
    with _one_compiles:
        _kept.clear()


def compile_anew(problem: Problem, seed: int) -> Compiled:
    """Compile the block computation for every device; the persistent cache keeps the result for the next process."""
    use_cache()
    seed_words = words(seed)
    example = make_chunk(problem, 0, CAPACITY, CAPACITY, CAPACITY * problem.block)
    begun = time.perf_counter()
    computation = jax.jit(partial(chunk_sums, problem))
    lowered = []
    for device in jax.local_devices():
        with jax.default_device(device):
            lowered.append(computation.lower(seed_words, example))
    program = hashlib.sha256(lowered[0].as_text().encode()).hexdigest()[:12]
    executables = tuple(each.compile() for each in lowered)
    return Compiled(executables, problem, seed_words, time.perf_counter() - begun, program)
