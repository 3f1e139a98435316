"""A run from experiment to results: resume, compute in threads, merge in block order, save, write tables."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from nlbench import runtime
from nlbench.config.schema import SystemSpec
from nlbench.engine.bounds import bounds_table
from nlbench.engine.compiled import CAPACITY, Compiled, compile_chunks
from nlbench.engine.finish import read_anew, traced, write
from nlbench.engine.interruption import stop_requests
from nlbench.engine.problem import make
from nlbench.engine.resume import checkpoint, finished_runs, resumed, same_program, sound
from nlbench.engine.workers import Threads, Workers, in_order
from nlbench.errors import Interrupted
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

Progress = Callable[[int, int], None]
SECONDS_BETWEEN_CHECKPOINTS = 5.0
CHECKPOINT_SHARE = 30  # ... or more, so that writing large ones takes a thirtieth of the time


def run(
    experiment: Experiment,
    own: System | DiscreteSystem | None,
    out: str | Path,
    progress: Progress | None = None,
) -> Results:
    """Compute what is missing of an experiment and write its results."""
    with stop_requests() as stopped:
        return _run(experiment, own, Path(out), progress or (lambda done, total: None), stopped)


def _run(
    experiment: Experiment,
    own: System | DiscreteSystem | None,
    out: Path,
    progress: Progress,
    stopped: Callable[[], bool],
) -> Results:
    problem = make(experiment, own)
    compiled = None
    if own is not None or experiment.plugins:
        compiled = compile_chunks(problem, experiment.monte_carlo.seed)
    if (
        own is not None and compiled
    ):  # what tells its results from those of another system is the program itself
        experiment = _identified(experiment, compiled.program)
    folder = RunFolder(out / experiment.experiment / experiment.hash12())
    with folder.locked():
        done = finished_runs(folder)
        runs = max(experiment.monte_carlo.runs, done or 0)
        if done == runs and sound(folder) and traced(folder, experiment):
            if experiment.plugins and compiled:
                same_program(folder, compiled)
            read_anew(folder, experiment)
            return Results(folder.path)
        begun = time.perf_counter()
        bounds = bounds_table(problem, experiment.monte_carlo.seed) if experiment.bounds else None
        compiled = compiled or compile_chunks(problem, experiment.monte_carlo.seed)
        totals = resumed(folder, compiled)
        folder.reopen()
        folder.write_experiment(experiment.resolved_yaml())
        runs = max(runs, totals.runs)
        threads = experiment.engine.threads or runtime.threads()
        chunk = experiment.engine.chunk or CAPACITY
        with Threads(compiled, runs, threads) as workers:
            totals = _compute(compiled, folder, totals, runs, workers, chunk, progress, stopped)
        seconds = time.perf_counter() - begun
        write(folder, experiment, compiled, totals, seconds, threads, bounds)
    return Results(folder.path)


def _identified(experiment: Experiment, program: str) -> Experiment:
    parameters = {**experiment.system.parameters, "program": program}
    return experiment.model_copy(update={"system": SystemSpec(name="own", parameters=parameters)})


def _compute(
    compiled: Compiled,
    folder: RunFolder,
    totals: Totals,
    runs: int,
    workers: Workers,
    chunk: int,
    progress: Progress,
    stopped: Callable[[], bool],
) -> Totals:
    """Totals of all runs. The checkpoint holds whole blocks; a last, partial one is added to a copy."""
    block = compiled.problem.block
    whole, rest = divmod(runs, block)
    saved, saved_at = totals.blocks, time.monotonic()
    progress(totals.runs, runs)
    pause = SECONDS_BETWEEN_CHECKPOINTS
    for first, sums in in_order(workers, totals.blocks, whole, chunk, stopped):
        totals.add(first, sums)
        progress(totals.runs, runs)
        begun = time.monotonic()
        if begun - saved_at > pause:
            checkpoint(folder, compiled, totals)
            saved, saved_at = totals.blocks, time.monotonic()
            pause = max(pause, CHECKPOINT_SHARE * (saved_at - begun))
    if totals.blocks != saved:
        checkpoint(folder, compiled, totals)
    if stopped():
        raise Interrupted(
            f"stopped after {totals.runs:,} of {runs:,} runs, which are saved; the same command goes on from there"
        )
    if rest:
        totals = totals.copy()
        totals.add(whole, compiled.sums(whole, 1, runs))
        progress(runs, runs)
    return totals
