"""What each filter costs: time per trajectory and step, operations, time to compile."""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters.partial_eval import dce_jaxpr

from nlbench.engine.block import followed, make_chunk, trajectories, words

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.engine.problem import Problem, Runner
    from nlbench.simulate import Simulated

MOST_BLOCKS = 16
MOST_STEPS = 500_000  # of all trajectories timed together
PASS_SECONDS = 0.2  # that one timing of a filter may take, unless a single block takes longer
FILTER_SECONDS = 2.0  # after which a filter is timed no more
ROUNDS = 7
ARITHMETIC = frozenset(
    "abs add atan2 cos div exp expm1 integer_pow log log1p max min mul neg pow rsqrt sin sqrt square sub tan "
    "tanh".split()
)


def cost_table(problem: Problem, seed: int, threads: int) -> pd.DataFrame:
    """`filter, ns_per_step, compile_seconds, operations_per_step, operations_per_update`.

    ns_per_step: one core, updates included, for one trajectory and one integration step; medians of interleaved
    rounds on the measurements of the first blocks, fewer blocks and rounds of a filter that takes long.
    compile_seconds: by the wall clock, while as many filters are compiled as there are threads. operations: scalar
    arithmetic before XLA shares any of it.
    """
    import pandas as pd

    steps = problem.schedule.segments * problem.schedule.segment_steps * problem.block
    blocks = max(1, min(MOST_BLOCKS, MOST_STEPS // steps))
    chunk = make_chunk(problem, 0, blocks, blocks, blocks * problem.block)
    data = jax.jit(lambda lanes: jax.lax.map(partial(trajectories, problem, words(seed)), lanes))(chunk.lanes)
    with ThreadPoolExecutor(threads) as pool:
        programs, compile_seconds = zip(
            *pool.map(partial(_compiled, problem, data), problem.runners), strict=True
        )
    seconds = _seconds(programs, data, blocks)
    counted = operations(problem)
    return pd.DataFrame(
        {
            "filter": [runner.label for runner in problem.runners],
            "ns_per_step": [1e9 * each / steps for each in seconds],
            "compile_seconds": compile_seconds,
            "operations_per_step": [step for step, _ in counted],
            "operations_per_update": [update for _, update in counted],
        }
    )


def _compiled(problem: Problem, data: Simulated, runner: Runner) -> tuple[Any, float]:
    """The program of one filter, and how long it took to make."""
    begun = time.perf_counter()
    program = jax.jit(partial(alone, problem, runner)).lower(data, np.int32(1)).compile()
    return program, time.perf_counter() - begun


def alone(problem: Problem, runner: Runner, data: Simulated, count: Any) -> Any:
    """One filter on the data of `count` blocks, which come again when there are no more; a sum, so that nothing is left
    out."""
    blocks = len(jax.tree.leaves(data)[0])

    def add_block(number: Any, total: Any) -> Any:
        block = jax.tree.map(lambda leaf: leaf[number % blocks], data)
        return total + jnp.sum(followed(problem, runner, block).components, axis=(0, 1))

    return jax.lax.fori_loop(0, count, add_block, jnp.zeros(problem.block))


def _seconds(programs: Sequence[Any], data: Simulated, blocks: int) -> list[float]:
    """Seconds that each program takes for one block: the median of rounds that take turns."""
    once = [_timed(program, data, 1) for program in programs]
    counts = [max(1, min(blocks, int(PASS_SECONDS / each))) for each in once]
    rounds = [
        min(ROUNDS, int(FILTER_SECONDS / (each * count))) for each, count in zip(once, counts, strict=True)
    ]
    found: list[list[float]] = [[] for _ in programs]
    for number in range(ROUNDS):
        for times, program, count, most in zip(found, programs, counts, rounds, strict=True):
            if number < most:
                times.append(_timed(program, data, count) / count)
    return [statistics.median(times or [each]) for times, each in zip(found, once, strict=True)]


def _timed(program: Any, data: Simulated, count: int) -> float:
    # Not timed: it finds another program's data in the caches.
    jax.block_until_ready(program(data, np.int32(1)))
    begun = time.perf_counter()
    jax.block_until_ready(program(data, np.int32(count)))
    return time.perf_counter() - begun


def operations(problem: Problem) -> list[tuple[int, int]]:
    """Arithmetic operations of one integration step and of one update, of one trajectory, for each filter."""
    return [_operations(problem, runner) for runner in problem.runners]


def _operations(problem: Problem, runner: Runner) -> tuple[int, int]:
    filter = runner.filter
    state = filter.init(runner.initial)
    y, start = jnp.zeros(problem.truth.measurements), problem.schedule.segment_times[0]
    step = jax.make_jaxpr(lambda state: filter.integrate(state, start, runner.step, 1))(state)
    update = jax.make_jaxpr(lambda state, y: filter.update(state, start, y)[0])(state, y)
    return _count(_needed(step.jaxpr)), _count(_needed(update.jaxpr))


def _needed(jaxpr: Any) -> Any:
    """Without what no output depends on."""
    return dce_jaxpr(jaxpr, [True] * len(jaxpr.outvars))[0]


def _count(jaxpr: Any) -> int:
    total = 0
    for equation in jaxpr.eqns:
        inner = [
            value for value in equation.params.values() if hasattr(value, "jaxpr") or hasattr(value, "eqns")
        ]
        repeats = equation.params.get("length", 1) if equation.primitive.name == "scan" else 1
        total += repeats * sum(_count(getattr(each, "jaxpr", each)) for each in inner)
        branches = equation.params.get("branches", ())  # one of which is taken
        total += max((_count(branch.jaxpr) for branch in branches), default=0)
        if equation.primitive.name in ARITHMETIC:
            total += int(np.prod(equation.outvars[0].aval.shape))
    return total
