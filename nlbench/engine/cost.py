"""What each filter costs: time per trajectory and step, operations, time to compile."""

from __future__ import annotations

import statistics
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters.partial_eval import dce_jaxpr

from nlbench.engine.block import followed, make_chunk, trajectories, words
from nlbench.runtime import threads

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.engine.problem import Problem, Runner
    from nlbench.simulate import Simulated

MOST_BLOCKS = 16
MOST_STEPS = 500_000  # of all trajectories timed together
ROUNDS = 7
ARITHMETIC = frozenset(
    "abs add atan2 cos div exp expm1 integer_pow log log1p max min mul neg pow rsqrt sin sqrt square sub tan "
    "tanh".split()
)


def cost_table(problem: Problem, seed: int) -> pd.DataFrame:
    """`filter, ns_per_step, compile_seconds, operations_per_step, operations_per_update`.

    ns_per_step: one core, updates included, for one trajectory and one integration step; medians of interleaved
    rounds on the measurements of the first blocks. compile_seconds: by the wall clock, while as many filters are
    compiled as there are threads. operations: scalar arithmetic before XLA shares any of it.
    """
    import pandas as pd

    steps = problem.schedule.segments * problem.schedule.segment_steps * problem.block
    blocks = max(1, min(MOST_BLOCKS, MOST_STEPS // steps))
    chunk = make_chunk(problem, 0, blocks, blocks, blocks * problem.block)
    data = jax.jit(lambda lanes: jax.lax.map(partial(trajectories, problem, words(seed)), lanes))(chunk.lanes)
    with ThreadPoolExecutor(threads()) as pool:
        programs, compile_seconds = zip(
            *pool.map(partial(_compiled, problem, data), problem.runners), strict=True
        )
    rounds = [[_seconds(program, data) for program in programs] for _ in range(ROUNDS)]
    counted = [operations(problem, runner) for runner in problem.runners]
    return pd.DataFrame(
        {
            "filter": [runner.label for runner in problem.runners],
            "ns_per_step": [
                1e9 * statistics.median(times) / (steps * blocks) for times in zip(*rounds, strict=True)
            ],
            "compile_seconds": compile_seconds,
            "operations_per_step": [step for step, _ in counted],
            "operations_per_update": [update for _, update in counted],
        }
    )


def _compiled(problem: Problem, data: Simulated, runner: Runner) -> tuple[Any, float]:
    """The program of one filter, and how long it took to make."""
    begun = time.perf_counter()
    program = jax.jit(partial(_alone, problem, runner)).lower(data).compile()
    return program, time.perf_counter() - begun


def _alone(problem: Problem, runner: Runner, data: Simulated) -> Any:
    """One filter on the data of some blocks; a sum, so that nothing is left out."""

    def block(data: Simulated) -> Any:
        return jnp.sum(followed(problem, runner, data).components, axis=(0, 1))

    return jax.lax.map(block, data)


def _seconds(program: Any, data: Simulated) -> float:
    jax.block_until_ready(program(data))  # not timed: it finds another program's data in the caches
    begun = time.perf_counter()
    jax.block_until_ready(program(data))
    return time.perf_counter() - begun


def operations(problem: Problem, runner: Runner) -> tuple[int, int]:
    """Arithmetic operations of one integration step and of one update, of one trajectory."""
    filter = runner.filter
    state = filter.init(runner.initial)
    y = jnp.zeros(problem.truth.measurements)
    step = jax.make_jaxpr(lambda state: filter.integrate(state, 0.0, runner.step, 1))(state)
    update = jax.make_jaxpr(lambda state, y: filter.update(state, 0.0, y)[0])(state, y)
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
