"""nlbench's own rows: its filters on given measurements, and the whole engine, on systems as a user writes them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from benchmarks import rows, workloads
from benchmarks.rows import SEED, Row, jax_row
from benchmarks.workloads import LANES, Workload

BLOCKS_OF_A_CALL = 32  # where a row makes its own data: enough that a call's overhead is shared, as in a run


def third_order(workload: Workload, y: np.ndarray) -> Row:
    """The third-order filter in blocks of 64, given measurements."""
    return _filter_row(rows.THIRD_BY_US, workload, y, "third-order")


def second_order(workload: Workload, y: np.ndarray) -> Row:
    """The second-order filter in the same way."""
    return _filter_row(rows.SECOND_BY_US, workload, y, "second-order")._replace(means=None)


def ekf(workload: Workload, y: np.ndarray) -> Row:
    """The extended Kalman filter in the same way."""
    return _filter_row(rows.THIRD_BY_US, workload, y, "ekf")


def simulated(workload: Workload, y: np.ndarray) -> Row:
    """What the C kernel with random numbers does: truth and measurements of its own, third-order filter, no tables."""
    import jax
    import jax.numpy as jnp

    from nlbench.engine import block, follow

    workload = workload._replace(blocks=BLOCKS_OF_A_CALL)
    stated = _problem(workload)
    chunk = block.make_chunk(stated, 0, workload.blocks, workload.blocks, workload.trajectories)
    lanes = jax.device_put(chunk.lanes)

    def one(lanes: Any) -> Any:
        data = block.trajectories(stated, block.words(SEED), lanes)
        followed = follow.follow(stated.runners[0], stated.schedule, data.measurements, LANES)
        return jnp.sum(data.states, axis=0), jnp.sum(followed.components, axis=0)

    begun = time.perf_counter()
    program = jax.jit(lambda lanes: jax.lax.map(one, lanes)).lower(lanes).compile()
    seconds = time.perf_counter() - begun
    call = lambda: jax.block_until_ready(program(lanes))  # noqa: E731
    return Row(rows.SIMULATED_BY_US, call, workload.work, seconds)


def engine(workload: Workload, y: np.ndarray) -> Row:
    """All that a run computes, on data of its own: random numbers, truth, third-order filter, statistics."""
    from nlbench.engine import compiled

    workload = workload._replace(blocks=BLOCKS_OF_A_CALL)
    made = compiled.compile_chunks(_problem(workload), SEED)

    def call() -> Any:
        return made.sums(0, workload.blocks, workload.trajectories)

    return Row("nlbench, whole engine", call, workload.work, made.seconds)


def system(workload: Workload) -> Any:
    """The workload as a user states it."""
    import jax.numpy as jnp

    import nlbench as nb

    def wrapped(y: Any, h: Any) -> Any:
        return (y - h) - 2 * jnp.pi * jnp.round((y - h) / (2 * jnp.pi))

    return nb.System(
        drift=lambda t, x: workload.drift(jnp, x),
        observe=lambda t, x: workload.observe(jnp, x),
        measurement_cov=workload.noise_cov,
        initial=nb.Moments(workload.mean, workload.cov),
        residual=wrapped if workload.wrapped else None,
        sample=_bounded_sample(workload) if workload.bounded else None,
        step=workload.step,
        interval=round(workload.step * workload.steps, 12),
    )


def _bounded_sample(workload: Workload) -> Any:
    """key -> (n,), true initial states as the workload's other rows draw them."""
    import jax

    cut = workloads.BOUND / workloads.BEFORE
    deviations = np.sqrt(np.diag(workload.cov))

    def sample(key: Any) -> Any:
        free, bounded = jax.random.split(key)
        draws = jax.random.normal(free, deviations.shape)
        inside = workloads.BEFORE * jax.random.truncated_normal(bounded, -cut, cut, (len(workload.bounded),))
        return workload.mean + deviations * draws.at[np.array(workload.bounded)].set(inside)

    return sample


def _problem(workload: Workload) -> Any:
    """The workload as an experiment states it."""
    from nlbench import config
    from nlbench.engine import problem

    own = system(workload)
    stated = config.from_dict(
        {
            "experiment": "benchmark/whole-engine",
            "system": {"name": "own", "interval": own.interval},
            "filters": ["third-order"],
            "time": {
                "end": round(own.interval * workload.times, 12),
                "step": own.step,
                "output": own.interval,
            },
            "monte_carlo": {"runs": workload.trajectories, "seed": SEED},
            "scores": False,  # the C program has none
        }
    )
    return problem.make(stated, own)


def _filter_row(name: str, workload: Workload, y: np.ndarray, filter: str) -> Row:
    """The engine's path of one filter, moments kept after each update."""
    import jax
    import jax.numpy as jnp

    import nlbench as nb
    from nlbench.engine.follow import follow
    from nlbench.engine.problem import Runner
    from nlbench.schedule import Schedule

    ours = nb.filters.build(filter, system(workload), missing=False)
    runner = Runner("benchmark", ours, ours.system.initial, workload.step, workload.steps)
    schedule = Schedule(workload.step, workload.steps, workload.times, measured_every=1, output_every=1)
    function = jax.jit(
        lambda y: jax.lax.map(lambda block: follow(runner, schedule, block, LANES).components, y)
    )
    n = len(workload.mean)

    def last_means(moments: Any) -> Any:  # (blocks, times, components, 64)
        return jnp.moveaxis(moments[:, -1, :n], 1, -1).reshape(-1, n)

    return jax_row(name, workload, function, workloads.by_blocks(y), last_means)
