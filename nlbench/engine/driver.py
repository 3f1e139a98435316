"""A run from experiment to results: resume, compute in threads, merge in block order, save, write tables."""

from __future__ import annotations

import datetime
import logging
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax

from nlbench import runtime
from nlbench.config.schema import SystemSpec
from nlbench.engine.compiled import CAPACITY, Compiled, compile_chunks
from nlbench.engine.cost import cost_table
from nlbench.engine.interruption import stop_requests
from nlbench.engine.problem import Problem, make
from nlbench.errors import DamagedResults, EnvironmentFault, Interrupted
from nlbench.results.fingerprint import differences, fingerprint
from nlbench.results.folder import RunFolder
from nlbench.results.manifest import commit, versions
from nlbench.results.results import Results
from nlbench.statistics.claims import evaluate
from nlbench.statistics.summary import tables
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.systems.system import System

Progress = Callable[[int, int], None]
SECONDS_BETWEEN_CHECKPOINTS = 5.0
log = logging.getLogger("nlbench")


def run(
    experiment: Experiment, own: System | None, out: str | Path, progress: Progress | None = None
) -> Results:
    """Compute what is missing of an experiment and write its results."""
    problem = make(experiment, own)
    compiled = None
    if own is not None:  # what tells its results from those of another system is the program itself
        compiled = compile_chunks(problem, experiment.monte_carlo.seed)
        experiment = _identified(experiment, compiled.program)
    folder = RunFolder(Path(out) / experiment.experiment / experiment.hash12())
    with folder.locked():
        done = _finished_runs(folder)
        runs = max(experiment.monte_carlo.runs, done or 0)
        if done == runs and _sound(folder):
            return Results(folder.path)
        folder.reopen()
        folder.write_experiment(experiment.resolved_yaml())
        begun = time.perf_counter()
        compiled = compiled or compile_chunks(problem, experiment.monte_carlo.seed)
        totals = _resumed(folder, compiled)
        runs = max(runs, totals.runs)
        threads = experiment.engine.threads or runtime.threads()
        totals = _compute(
            compiled, folder, totals, runs, threads, experiment.engine.chunk or CAPACITY, progress
        )
        seconds = time.perf_counter() - begun
        _write(folder, experiment, compiled, totals, seconds, threads)
    return Results(folder.path)


def _identified(experiment: Experiment, program: str) -> Experiment:
    parameters = {**experiment.system.parameters, "program": program}
    return experiment.model_copy(update={"system": SystemSpec(name="own", parameters=parameters)})


def _finished_runs(folder: RunFolder) -> int | None:
    try:
        return folder.done_runs()
    except DamagedResults as fault:
        log.warning("%s; it is written anew", fault)
        return None


def _sound(folder: RunFolder) -> bool:
    """Whether a finished run still is what it wrote."""
    try:
        faults = Results(folder.path).damaged()
    except DamagedResults as unreadable:
        faults = [str(unreadable)]
    for fault in faults:
        log.warning("%s; it is computed anew", fault)
    return not faults


def _resumed(folder: RunFolder, compiled: Compiled) -> Totals:
    """Totals of the checkpoint, or fresh ones. Raises `EnvironmentFault` if other software made the checkpoint."""
    try:
        saved = folder.load_checkpoint()
    except DamagedResults as fault:
        log.warning("%s; the run starts again", fault)
        saved = None
    if saved is None:
        return Totals(compiled.problem.layout)
    arrays, facts = saved
    changed = differences(_numerics(compiled), facts["fingerprint"])
    if changed:
        raise EnvironmentFault(
            f"{folder.path} was computed with other software or hardware ({'; '.join(changed)}), and mixing them "
            "would change digits: choose another folder with --out, or delete that one"
        )
    return Totals.from_state(compiled.problem.layout, arrays)


def _compute(
    compiled: Compiled,
    folder: RunFolder,
    totals: Totals,
    runs: int,
    threads: int,
    chunk: int,
    progress: Progress | None,
) -> Totals:
    """Totals of all runs. The checkpoint holds whole blocks; a last, partial one is added to a copy."""
    block = compiled.problem.block
    whole, rest = divmod(runs, block)
    report = progress or (lambda done, total: None)
    saved, saved_at = totals.blocks, time.monotonic()
    report(totals.runs, runs)
    with stop_requests() as stopped:
        for first, sums in _in_order(compiled, totals.blocks, whole, runs, threads, chunk, stopped):
            totals.add(first, sums)
            report(totals.runs, runs)
            if time.monotonic() - saved_at > SECONDS_BETWEEN_CHECKPOINTS:
                _checkpoint(folder, compiled, totals)
                saved, saved_at = totals.blocks, time.monotonic()
        if totals.blocks != saved:
            _checkpoint(folder, compiled, totals)
        if stopped() and totals.blocks < whole:
            raise Interrupted(
                f"stopped after {totals.runs:,} of {runs:,} runs, which are saved; the same command goes on from there"
            )
    if rest:
        totals = totals.copy()
        totals.add(whole, compiled.sums(whole, 1, runs))
        report(runs, runs)
    return totals


def _in_order(
    compiled: Compiled,
    first: int,
    last: int,
    runs: int,
    threads: int,
    chunk: int,
    stopped: Callable[[], bool],
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Sums of blocks first ... last - 1 in order, computed by threads that run ahead; ends early when stopped."""
    size = min(chunk, CAPACITY, max(1, -(-(last - first) // (4 * threads))))
    starts = iter(range(first, last, size))
    pending: deque[tuple[int, Future]] = deque()
    with ThreadPoolExecutor(threads) as pool:
        while True:
            while len(pending) < 2 * threads and not stopped() and (start := next(starts, None)) is not None:
                pending.append((start, pool.submit(compiled.sums, start, min(size, last - start), runs)))
            if not pending:
                return
            start, future = pending.popleft()
            yield start, future.result()


def _checkpoint(folder: RunFolder, compiled: Compiled, totals: Totals) -> None:
    folder.save_checkpoint(totals.state(), fingerprint=_numerics(compiled))


def _numerics(compiled: Compiled) -> dict[str, str]:
    """Everything that decides the last bits: software, hardware, settings, and the program itself."""
    return {**fingerprint(_device()), "program": compiled.program}


def _device() -> str:
    return jax.devices()[0].device_kind


def _write(
    folder: RunFolder,
    experiment: Experiment,
    compiled: Compiled,
    totals: Totals,
    seconds: float,
    threads: int,
) -> None:
    problem: Problem = compiled.problem
    made = tables(totals)
    if experiment.claims:
        made["claims"] = evaluate(experiment.claims, made["statistics"], made["paired"])
    made["cost"] = cost_table(problem, experiment.monte_carlo.seed)
    folder.write_tables(made)
    folder.finish(
        totals.runs,
        experiment=experiment.experiment,
        hash=experiment.hash12(),
        seed=experiment.monte_carlo.seed,
        block=problem.block,
        precision=experiment.engine.precision,
        threads=threads,
        units=dict(zip(problem.layout.magnitudes, problem.layout.magnitude_units, strict=True)),
        versions=versions(),
        commit=commit(),
        device=_device(),
        fingerprint=_numerics(compiled),
        finished=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        seconds=round(seconds, 3),
        compile_seconds=round(compiled.seconds, 3),
    )
