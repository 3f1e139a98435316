"""The plan of a run: what is to be done, and what each part of it costs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from nlbench import runtime
from nlbench.engine.bounds import bounds_table
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.planning import machine, sizes
from nlbench.engine.planning.calibration import calibrate
from nlbench.engine.planning.compilation import listening
from nlbench.engine.planning.durations import Measured, Work, durations
from nlbench.engine.planning.memory import memory
from nlbench.engine.problem import make
from nlbench.engine.resume import finished_runs, resumed
from nlbench.results.folder import RunFolder
from nlbench.statistics.consistency import consistency_table
from nlbench.statistics.summary import tables

if TYPE_CHECKING:
    from collections.abc import Callable

    from nlbench.config import Experiment
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.problem import Problem
    from nlbench.schedule import Schedule
    from nlbench.statistics.totals import Totals
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


T = TypeVar("T")
Amount = TypeVar("Amount", int, float)


def plan(
    experiment: Experiment, own: System | DiscreteSystem | None = None, out: str | Path = "results"
) -> dict[str, Any]:
    """Counts; seconds, bytes of memory and bytes of disk by part, the last entry of each their sum.

    What lies in `out` is taken off: finished runs, and those of a checkpoint (of a user's own system neither is looked
    for). Nothing is written but the cache of compiled programs. Raises what `run` would raise before it computes.
    """
    problem, stated = _timed(lambda: make(experiment, own))
    before = machine.resident()
    with listening() as heard:
        compiled, seconds = _timed(lambda: compile_chunks(problem, experiment.monte_carlo.seed))
    grown = machine.resident() - before
    folder = RunFolder(Path(out) / experiment.experiment / experiment.hash12()) if own is None else None
    runs, done, saved = _done(experiment, folder, compiled)
    threads = experiment.engine.threads or runtime.threads()
    held = machine.resident()
    calibration = calibrate(compiled, threads)
    bounds = (
        _timed(lambda: bounds_table(problem, experiment.monte_carlo.seed))[1] if experiment.bounds else 0.0
    )
    sample, tabled = _timed(lambda: _written(problem, calibration.totals))
    kept = min(runs, problem.layout.keep_runs)
    values = kept * len(problem.layout.filters) * len(problem.layout.reports)
    state = sizes.state(calibration.totals, runs)
    diverged = bool((calibration.totals.groups["first_lost"] > 0).any())
    pictures = sizes.pictures(experiment, problem.layout, diverged)
    blocks = 0 if done == runs else max(0, -(-runs // problem.block) - (saved.blocks if saved else 0))
    work = Work(blocks, values, state, pictures, len(experiment.claims), done == runs)
    measured = Measured(stated, bounds, tabled, machine.slowness(), heard.compilation(seconds), calibration)
    disk = _disk(sample, calibration.totals, kept, state) | {
        "figures_and_report": sizes.drawn(pictures, problem.layout)
    }
    steps = problem.schedule.segments * problem.schedule.segment_steps
    return {
        "filters": list(experiment.labels),
        "runs": runs,
        "runs_done": done if done == runs else saved.runs if saved else 0,
        "steps_per_run": steps,
        "filter_steps": len(experiment.labels) * runs * steps,
        **_measurements(problem.schedule),
        "blocks": blocks,
        "threads": threads,
        "seconds": _summed(durations(problem, work, measured, threads)),
        "memory_bytes": _summed(memory(compiled, problem, state, values, threads, held, grown)),
        "disk_bytes": _summed(disk),
    }


def _timed(made: Callable[[], T]) -> tuple[T, float]:
    begun = time.perf_counter()
    result = made()
    return result, time.perf_counter() - begun


def _done(
    experiment: Experiment, folder: RunFolder | None, compiled: Compiled
) -> tuple[int, int | None, Totals | None]:
    """How many runs there will be, how many are finished, and the totals of a checkpoint."""
    asked = experiment.monte_carlo.runs
    if folder is None or not folder.path.is_dir():
        return asked, None, None
    done, saved = finished_runs(folder), resumed(folder, compiled)
    return max(asked, done or 0, saved.runs), done, saved


def _written(problem: Problem, totals: Totals) -> dict[str, int]:
    """Bytes of the tables that these totals make."""
    made = tables(totals)
    made["consistency"] = consistency_table(totals, made["statistics"], problem.truth.measurements)
    return sizes.written(made)


def _disk(sample: dict[str, int], totals: Totals, kept: int, state: int) -> dict[str, int]:
    """Bytes of the files with numbers; a checkpoint is there twice while it is replaced."""
    in_sample = min(totals.kept.count, totals.layout.keep_runs)
    rows = sample.pop(sizes.KEPT) * kept // in_sample if in_sample else 0
    return {
        "checkpoint": state,
        "checkpoint_replaced": state,
        "tables": sum(sample.values()),
        "kept_runs": rows,
    }


def _summed(parts: dict[str, Amount]) -> dict[str, Amount]:
    return {**parts, "total": sum(parts.values())}


def _measurements(schedule: Schedule) -> dict[str, int]:
    """How many are taken at fixed times; or for how many there is room, if they wait for an angle."""
    if schedule.sightings:
        return {"most_sightings_per_run": schedule.sightings}
    return {"measurements_per_run": schedule.measurements}
