"""The engine: blocks of trajectories through truth, filters and statistics, on all cores, resumable at any moment."""

from __future__ import annotations

from typing import Any

__all__ = ["check", "plan", "replay", "run", "verify"]


def run(
    experiment: Any, out: Any = None, progress: Any = None, check: Any = None, dask: str | None = None
) -> Any:
    """Run an experiment, or go on with one that was stopped, and return its `Results`.

    experiment: an `Experiment`, a path of an experiment file, or a dict with the keys of one, whose `system` may be a
        `System` or `DiscreteSystem` of your own.
    out: folder of results (default "results"). progress: called with (runs done, runs in all). check: called before
        anything is computed, and may raise (`nlbench.engine.planning.space.require` where room is short).
    dask: compute with the workers of a dask scheduler, "tcp://HOST:PORT", or with "local:N" processes.
    Raises `ConfigError` before anything is computed, `LockedError` where another process runs the same experiment,
    `EnvironmentFault` for disk and memory, `Interrupted` after Ctrl-C with everything so far saved.
    """
    from nlbench.engine.driver import run

    return run(*_stated(experiment), "results" if out is None else out, progress, check, dask)


def plan(experiment: Any, out: Any = None, precision: str | None = None) -> dict[str, Any]:
    """What `run` with the same `out` would cost: counts; seconds and bytes of memory and of disk, each by part.

    precision: such as "rms:1%", which then chooses the runs.
    """
    from nlbench.config.precision import parse
    from nlbench.engine.memory import memory_faults
    from nlbench.engine.planning.plan import plan

    asked = None if precision is None else parse(precision, "precision")
    with memory_faults():
        return plan(*_stated(experiment), "results" if out is None else out, asked)


def check(experiment: Any) -> None:
    """Raises `ConfigError` with what only shows when systems and filters are made, such as shapes that do not fit."""
    from nlbench.engine.problem import make

    make(*_stated(experiment))


def replay(experiment: Any, label: str, trajectory: int) -> Any:
    """One trajectory of one filter in full, as a DataFrame, recomputed with its whole block."""
    from nlbench.engine.memory import memory_faults
    from nlbench.engine.trace import replay

    with memory_faults():
        return replay(*_stated(experiment), label, trajectory)


def verify(results: Any, block: int | None = None) -> Any:
    """Whether a finished run still is what it wrote, and one of its blocks, with its group, comes out again.

    results: `Results` or the folder of a run. block: its number; a random one unless said. Returns a `Verified`, whose
    `faults` is empty where nothing is wrong; writes nothing.
    """
    from nlbench.engine.verification import verify
    from nlbench.results.results import Results

    return verify(results if isinstance(results, Results) else Results(results), block)


def _stated(given: Any) -> tuple[Any, Any]:
    """The experiment, and the user's own system if there is one."""
    from nlbench import config, runtime, systems
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.own import recorded
    from nlbench.systems.system import System

    own = None
    if isinstance(given, config.Experiment):
        experiment = given
    elif isinstance(given, dict):
        if isinstance(given.get("system"), (System, DiscreteSystem)):
            own = given["system"]
            given = {**given, "system": {"name": systems.OWN, **recorded(own)}}
        experiment = config.from_dict(given)
    else:
        experiment = config.load(given)
    runtime.configure(precision=experiment.engine.precision)
    return experiment, own
