"""A run from experiment to results: resume, compute in threads, merge in block order, save, write tables."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, closing, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from nlbench import runtime
from nlbench.config.schema import SystemSpec
from nlbench.engine.bounds import bounds_table
from nlbench.engine.cluster import Dask, Opened, opening
from nlbench.engine.compiled import CAPACITY, Compiled, compile_chunks
from nlbench.engine.finish import complete, read_anew, write
from nlbench.engine.interruption import stop_requests
from nlbench.engine.memory import Load, memory_faults
from nlbench.engine.problem import make
from nlbench.engine.remote import Task
from nlbench.engine.resume import Saver, finished_runs, numerics, resumed, same_program, sound
from nlbench.engine.workers import Threads, Workers, busy, in_order
from nlbench.errors import ConfigError, Interrupted
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

Progress = Callable[[int, int], None]
Check = Callable[[Compiled, Totals, int, int, Path], None]  # program, totals, runs, threads, folder


def run(
    experiment: Experiment,
    own: System | DiscreteSystem | None,
    out: str | Path,
    progress: Progress | None = None,
    check: Check | None = None,
    dask: str | None = None,
) -> Results:
    """Compute what is missing of an experiment and write its results.

    check: may raise before anything is computed. dask: where its workers are, if they are not threads of this process.
    """
    if dask is not None and own is not None:
        raise ConfigError(
            "a system that exists in this process only cannot be sent to dask workers: name one"
        )
    with stop_requests() as stopped, memory_faults():
        return _run(experiment, own, Path(out), progress or (lambda done, total: None), stopped, check, dask)


def _run(
    experiment: Experiment,
    own: System | DiscreteSystem | None,
    out: Path,
    progress: Progress,
    stopped: Callable[[], bool],
    check: Check | None,
    dask: str | None,
) -> Results:
    problem = make(experiment, own)
    compiled = None
    if own is not None or experiment.plugins:
        compiled = compile_chunks(problem, experiment.monte_carlo.seed)
    if own is not None and compiled:
        # What tells its results from those of another system is the program itself.
        experiment = _identified(experiment, compiled.program)
    folder = RunFolder(experiment.folder(out))
    with folder.locked():
        done = finished_runs(folder)
        runs = max(experiment.monte_carlo.runs, done or 0)
        if done == runs and sound(folder) and complete(folder, experiment):
            if experiment.plugins and compiled:
                same_program(folder, compiled)
            read_anew(folder, experiment)
            return Results(folder.path)
        begun = time.perf_counter()
        bounds = bounds_table(problem, experiment.monte_carlo.seed) if experiment.bounds else None
        with opening(dask) if dask else nullcontext() as opened:  # while this process compiles
            compiled = compiled or compile_chunks(problem, experiment.monte_carlo.seed)
            totals = resumed(folder, compiled)
            runs = max(runs, totals.runs)
            experiment = experiment.of_runs(runs)
            threads = experiment.engine.threads or runtime.threads()
            if check is not None:
                check(compiled, totals, runs, threads, folder.path)
            folder.reopen()
            folder.write_experiment(experiment.resolved_yaml())
            chunk = experiment.engine.chunk or CAPACITY
            with _workers(experiment, compiled, runs, threads, opened) as workers:
                totals = compute(compiled, folder, totals, runs, workers, chunk, progress, stopped)
        seconds = time.perf_counter() - begun
        write(folder, experiment, compiled, totals, seconds, threads, stopped, bounds)
    return Results(folder.path)


def _workers(
    experiment: Experiment, compiled: Compiled, runs: int, threads: int, opened: Future[Opened] | None
) -> AbstractContextManager[Workers]:
    """Threads of this process, or the workers of a cluster."""
    if opened is None:
        return Threads(compiled, runs, threads)
    decides, allowed = tuple(numerics(compiled).items()), tuple(experiment.plugins)
    task = Task(experiment.resolved_yaml(), runs, decides, allowed)
    return Dask(opened.result().client, task)


def _identified(experiment: Experiment, program: str) -> Experiment:
    parameters = {**experiment.system.parameters, "program": program}
    return experiment.model_copy(update={"system": SystemSpec(name="own", parameters=parameters)})


def compute(
    compiled: Compiled,
    folder: RunFolder,
    totals: Totals,
    runs: int,
    workers: Workers,
    chunk: int,
    progress: Progress,
    stopped: Callable[[], bool],
) -> Totals:
    """Totals of all runs. The checkpoint holds whole blocks; a last, partial one is added to a copy.

    Whatever ends it early, what was added is saved first; where memory runs out, it goes on with less at a time.
    """
    whole, rest = divmod(runs, compiled.problem.block)
    saver, load = Saver(folder, compiled, totals), Load(chunk)
    progress(totals.runs, runs)
    while totals.blocks < whole and not stopped():
        adding = False
        try:
            parts = in_order(workers, totals.blocks, whole, load.chunk, stopped, load.ahead)
            with closing(parts):
                for first, sums in parts:
                    adding = True
                    totals.add(first, sums)
                    adding = False
                    progress(totals.runs, runs)
                    saver.now_and_then(totals)
        except Exception as error:
            if adding:  # half a block may have been added
                totals = resumed(folder, compiled)
                if totals.share != compiled.share:  # a shard's checkpoint was removed
                    raise
            saver.save(totals)
            load = load.halved(error, busy(workers))
    saver.save(totals)
    if stopped():
        raise Interrupted(
            f"stopped after {totals.runs:,} of {runs:,} runs, which are saved; the same command goes on from there"
        )
    if rest:
        totals = totals.copy()
        totals.add(whole, compiled.sums(whole, 1, runs))
        progress(runs, runs)
    return totals
