"""The compiled block computation, made once and called from every thread."""

from __future__ import annotations

import hashlib
import os
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from nlbench.engine.block import View, chunk_sums, make_chunk, words
from nlbench.statistics.share import ALL, Share

if TYPE_CHECKING:
    from nlbench.engine.problem import Problem

CAPACITY = (
    64  # blocks of a call at most; one size for all, since XLA may compile another one to other last bits
)


class Compiled(NamedTuple):
    """A compiled `chunk_sums` of at most `CAPACITY` blocks a call; `program` identifies what was compiled."""

    executable: Any
    problem: Problem
    seed: tuple[Any, Any]
    seconds: float
    program: str
    share: Share = ALL

    def sums(self, first_block: int, count: int, runs: int) -> dict[str, np.ndarray]:
        """Sums of blocks first_block ... first_block + count - 1 of the share, on the host."""
        chunk = make_chunk(self.problem, first_block, count, CAPACITY, runs, share=self.share)
        sums, _ = self.executable(self.seed, chunk)
        return {name: np.asarray(value)[:count] for name, value in sums.items()}

    def view(self, trajectory: int) -> View:
        """One trajectory in full, computed with its block by the same executable."""
        block, lane = divmod(trajectory, self.problem.block)
        chunk = make_chunk(self.problem, block, 1, CAPACITY, trajectory + 1, (0, lane))
        return jax.tree.map(np.asarray, self.executable(self.seed, chunk)[1])


def compile_chunks(problem: Problem, seed: int) -> Compiled:
    """Compile the block computation; the persistent cache keeps the result for the next process."""
    use_cache()
    seed_words = words(seed)
    example = make_chunk(problem, 0, CAPACITY, CAPACITY, CAPACITY * problem.block)
    begun = time.perf_counter()
    lowered = jax.jit(partial(chunk_sums, problem)).lower(seed_words, example)
    program = hashlib.sha256(lowered.as_text().encode()).hexdigest()[:12]
    executable = lowered.compile()
    return Compiled(executable, problem, seed_words, time.perf_counter() - begun, program)


def use_cache() -> None:
    """Keep compiled programs on disk, in $NLBENCH_CACHE or the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = os.environ.get("NLBENCH_CACHE") or Path(base) / "nlbench" / "xla"
    if jax.config.jax_compilation_cache_dir != str(folder):  # type: ignore[attr-defined]
        jax.config.update("jax_compilation_cache_dir", str(folder))
        compilation_cache.reset_cache()  # jax stays with the folder of its first compilation
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
