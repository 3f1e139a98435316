"""What a run would cost, from its compiled program and a short calibration."""

from __future__ import annotations

import resource
import time
from typing import TYPE_CHECKING, Any

from nlbench import runtime
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.schedule import Schedule
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

CALIBRATION_BLOCKS = 16


def plan(experiment: Experiment, own: System | DiscreteSystem | None = None) -> dict[str, Any]:
    """Runs, blocks, steps, filters; seconds to compile and to run; bytes of memory and disk.

    Memory is the peak of this process, which has just done the same; it does not grow with the number of runs.
    """
    problem = make(experiment, own)
    compiled = compile_chunks(problem, experiment.monte_carlo.seed)
    runs, threads = experiment.monte_carlo.runs, experiment.engine.threads or runtime.threads()
    blocks = -(-runs // problem.block)
    count = CALIBRATION_BLOCKS
    totals, times = Totals(problem.layout), []
    for turn in range(3):
        begun = time.perf_counter()
        sums = compiled.sums(turn * count, count, (turn + 1) * count * problem.block)
        totals.add(turn * count, sums)
        times.append(time.perf_counter() - begun)
    state = sum(array.nbytes for array in totals.state().values())
    return {
        "runs": runs,
        "blocks": blocks,
        "steps_per_run": problem.schedule.segments * problem.schedule.segment_steps,
        **_measurements(problem.schedule),
        "filters": list(experiment.labels),
        "threads": threads,
        "compile_seconds": compiled.seconds,
        "run_seconds": min(times) / count * blocks / threads,
        "memory_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "disk_bytes": 2 * state,
    }


def _measurements(schedule: Schedule) -> dict[str, int]:
    """How many are taken at fixed times; or for how many there is room, if they wait for an angle."""
    if schedule.sightings:
        return {"most_sightings_per_run": schedule.sightings}
    return {"measurements_per_run": schedule.measurements}
