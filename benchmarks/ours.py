"""nlbench's own rows: its filters on given measurements, and the whole engine."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks import workloads
from benchmarks.rows import SEED, Row, jax_row
from benchmarks.workloads import LANES, Workload


def third_order(workload: Workload, y: np.ndarray) -> Row:
    """The third-order filter in blocks of 64, given measurements."""
    import nlbench as nb

    return _filter_row(
        workload, y, nb.filters.build("third-order", nb.systems.build("culver-scalar"), missing=False)
    )


def ekf(workload: Workload, y: np.ndarray) -> Row:
    """The extended Kalman filter in blocks of 64, given measurements."""
    import jax.numpy as jnp

    import nlbench as nb

    system = nb.System(
        drift=lambda t, x: workload.drift(jnp, x),
        observe=lambda t, x: workload.observe(jnp, x),
        measurement_cov=workload.noise_cov,
        initial=nb.Moments(workload.mean, workload.cov),
    )
    return _filter_row(workload, y, nb.filters.build("ekf", system, missing=False))


def simulated(workload: Workload, y: np.ndarray) -> Row:
    """What the C kernel with random numbers does: truth and measurements of its own, third-order filter, no tables."""
    import jax
    import jax.numpy as jnp

    from nlbench.engine import block, follow

    stated = _problem(workload)
    chunk = block.make_chunk(stated, 0, workload.blocks, workload.blocks, workload.trajectories)

    def one(lanes: Any) -> Any:
        states, measurements = block.trajectories(stated, block.words(SEED), lanes)
        followed = follow.follow(stated.runners[0], stated.schedule, measurements, LANES)
        return jnp.sum(states, axis=0), jnp.sum(followed.components, axis=0)

    begun = time.perf_counter()
    program = jax.jit(lambda lanes: jax.lax.map(one, lanes)).lower(chunk.lanes).compile()
    seconds = time.perf_counter() - begun
    call = lambda: jax.block_until_ready(program(chunk.lanes))  # noqa: E731
    return Row("nlbench, with random numbers and truth", call, workload.work, seconds)


def engine(workload: Workload, y: np.ndarray) -> Row:
    """All that a run computes, on data of its own: random numbers, truth, third-order filter, statistics."""
    from nlbench.engine import compiled

    made = compiled.compile_chunks(_problem(workload), SEED)

    def call() -> Any:
        return made.sums(0, workload.blocks, workload.trajectories)

    return Row("nlbench, whole engine", call, workload.work, made.seconds)


def _problem(workload: Workload) -> Any:
    """The workload as an experiment states it."""
    from nlbench import config
    from nlbench.engine import problem

    end, interval = workload.step * workload.steps * workload.times, workload.step * workload.steps
    return problem.make(
        config.from_dict(
            {
                "experiment": "benchmark/whole-engine",
                "system": {"name": "culver-scalar"},
                "filters": ["third-order"],
                "time": {"end": round(end, 12), "step": workload.step, "output": round(interval, 12)},
                "monte_carlo": {"runs": workload.trajectories, "seed": SEED},
            }
        )
    )


def _filter_row(workload: Workload, y: np.ndarray, ours: Any) -> Row:
    """The engine's path of one filter, moments kept after each update."""
    import jax
    import jax.numpy as jnp

    from nlbench.engine.follow import follow
    from nlbench.engine.problem import Runner
    from nlbench.schedule import Schedule

    runner = Runner("benchmark", ours, ours.system.initial, workload.step, workload.steps)
    schedule = Schedule(workload.step, workload.steps, workload.times, measured_every=1, output_every=1)
    function = jax.jit(
        lambda y: jax.lax.map(lambda block: follow(runner, schedule, block, LANES).components, y)
    )
    n = len(workload.mean)

    def last_means(moments: Any) -> Any:  # (blocks, times, components, 64)
        return jnp.moveaxis(moments[:, -1, :n], 1, -1).reshape(-1, n)

    return jax_row("nlbench, filter alone", workload, function, workloads.by_blocks(y), last_means)
