"""The plan of a run: what is to be done, and what each part of it costs."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from nlbench import runtime
from nlbench.engine import cost
from nlbench.engine.bounds import bounds_table
from nlbench.engine.compiled import compile_anew
from nlbench.engine.finish import of_totals
from nlbench.engine.planning import machine, sizes
from nlbench.engine.planning.calibration import calibrate, extend
from nlbench.engine.planning.compilation import listening
from nlbench.engine.planning.durations import Measured, Work, durations, shares
from nlbench.engine.planning.memory import memory, process
from nlbench.engine.planning.precision import Chosen, needed, pilot_runs
from nlbench.engine.problem import make
from nlbench.engine.resume import finished_runs, resumed
from nlbench.results import atomic
from nlbench.results.folder import RunFolder
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from collections.abc import Callable

    from nlbench.config import Experiment
    from nlbench.config.precision import Precision
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.problem import Problem
    from nlbench.schedule import Schedule
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

T = TypeVar("T")
Amount = TypeVar("Amount", int, float)


class Left(NamedTuple):
    """How many runs there will be in all, how many are there, whether their tables are, and blocks to compute."""

    runs: int
    done: int
    finished: bool
    blocks: int


def plan(
    experiment: Experiment,
    own: System | DiscreteSystem | None = None,
    out: str | Path = "results",
    precision: Precision | None = None,
) -> dict[str, Any]:
    """Counts; seconds, bytes of memory and bytes of disk by part, the last entry of each their sum.

    What lies in `out` is taken off: finished runs, and those of a checkpoint (of a user's own system neither is looked
    for). Nothing is written but the cache of compiled programs. The program is compiled anew, as in another process.
    Raises what `run` would raise before it computes.
    """
    problem, stated = _timed(lambda: make(experiment, own))
    before = machine.resident()
    with listening() as heard:
        compiled, seconds = _timed(lambda: compile_anew(problem, experiment.monte_carlo.seed))
    after = machine.resident()
    threads = experiment.engine.threads or runtime.threads()
    folder = RunFolder(experiment.folder(out)) if own is None else None
    saved = resumed(folder, compiled) if folder and folder.path.is_dir() else None
    calibration = calibrate(compiled, threads)
    chosen = _chosen(precision, compiled, saved, calibration.totals, threads) if precision else None
    asked = chosen.runs if chosen else experiment.monte_carlo.runs
    left = _left(asked, problem.block, saved, folder)
    totals = _at_most(left.runs, compiled, calibration.totals, threads)
    files, tabled = _timed(lambda: _files(experiment, problem, totals, left.runs))
    pictures = _pictures(experiment, problem, totals)
    values = min(left.runs, problem.layout.keep_runs) * len(experiment.labels) * len(problem.layout.reports)
    work = Work(left.blocks, values, files["checkpoint"], pictures, len(experiment.claims), left.finished)
    counted, counting = _timed(lambda: cost.operations(problem))
    measured = Measured(
        problem=stated,
        bounds=_bounds(experiment, problem),
        tables=tabled,
        counting=counting,
        shares=shares(problem, counted),
        slowness=machine.slowness(),
        compilation=heard.compilation(seconds),
        calibration=calibration,
    )
    needs = memory(compiled, problem, files["checkpoint"], values, threads, process(before, after))
    return {
        **_counts(experiment, problem, left),
        "threads": threads,
        **({"precision": {"asked": str(precision), **chosen._asdict()}} if chosen else {}),
        "seconds": _summed(durations(problem, work, measured, threads)),
        "memory_bytes": _summed(needs),
        "memory_free_bytes": machine.free_memory(),
        "disk_bytes": _summed(files),
        "disk_free_bytes": atomic.free_disk(Path(out)),
    }


def _timed(made: Callable[[], T]) -> tuple[T, float]:
    begun = time.perf_counter()
    result = made()
    return result, time.perf_counter() - begun


def _bounds(experiment: Experiment, problem: Problem) -> float:
    """Seconds of the table of bounds, if it is asked for."""
    if not experiment.bounds:
        return 0.0
    return _timed(lambda: bounds_table(problem, experiment.monte_carlo.seed))[1]


def _chosen(
    precision: Precision, compiled: Compiled, saved: Totals | None, totals: Totals, threads: int
) -> Chosen:
    """The runs that a precision needs; `totals` are extended to the pilot where `saved` do not hold it."""
    block, pilot = compiled.problem.block, pilot_runs(compiled.problem.layout)
    if saved is not None and saved.kept.count >= pilot:
        return needed(precision, saved, block)
    extend(compiled, totals, math.ceil(pilot / block), threads)
    return needed(precision, totals, block)


def _at_most(runs: int, compiled: Compiled, totals: Totals, threads: int) -> Totals:
    """These totals, or those of the run where that is shorter than what was computed to time it."""
    if totals.runs <= runs:
        return totals
    shorter = Totals(compiled.problem.layout)
    extend(compiled, shorter, math.ceil(runs / compiled.problem.block), threads)
    return shorter


def _left(asked: int, block: int, saved: Totals | None, folder: RunFolder | None) -> Left:
    finished = finished_runs(folder) if folder else None
    there = saved.runs if saved else 0
    runs = max(asked, finished or 0, there)
    if finished == runs:
        return Left(runs, runs, True, 0)
    return Left(runs, there, False, math.ceil(runs / block) - (saved.blocks if saved else 0))


def _counts(experiment: Experiment, problem: Problem, left: Left) -> dict[str, Any]:
    steps = problem.schedule.segments * problem.schedule.segment_steps
    return {
        "filters": list(experiment.labels),
        "runs": left.runs,
        "runs_done": left.done,
        "steps_per_run": steps,
        "filter_steps": len(experiment.labels) * left.runs * steps,
        **_measurements(problem.schedule),
        "blocks": math.ceil(left.runs / problem.block),
        "blocks_left": left.blocks,
    }


def _measurements(schedule: Schedule) -> dict[str, int]:
    """How many are taken at fixed times; or for how many there is room, if they wait for an angle."""
    if schedule.sightings:
        return {"most_sightings_per_run": schedule.sightings}
    return {"measurements_per_run": schedule.measurements}


def _files(experiment: Experiment, problem: Problem, totals: Totals, runs: int) -> dict[str, int]:
    """Bytes of what is written, from the tables of some runs; a checkpoint is there twice while it is replaced."""
    written = sizes.written(of_totals(problem, totals))
    of_kept, rows = written.pop(sizes.KEPT), min(totals.kept.count, problem.layout.keep_runs)
    checkpoint = sizes.checkpoint(totals, runs)
    return {
        "checkpoint": checkpoint,
        "checkpoint_replaced": checkpoint,
        "tables": sum(written.values()),
        "kept_runs": of_kept * min(runs, problem.layout.keep_runs) // rows if rows else 0,
        "figures_and_report": sizes.drawn(_pictures(experiment, problem, totals), problem.layout),
    }


def _pictures(experiment: Experiment, problem: Problem, totals: Totals) -> int:
    return sizes.pictures(experiment, problem.layout, bool((totals.groups["first_lost"] > 0).any()))


def _summed(parts: dict[str, Amount]) -> dict[str, Amount]:
    return {**parts, "total": sum(parts.values())}
