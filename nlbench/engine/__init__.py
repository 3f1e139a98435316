"""The engine: blocks of trajectories through truth, filters and statistics, on all cores, resumable at any moment."""

from __future__ import annotations

from typing import Any

__all__ = ["check", "plan", "replay", "run"]


def run(experiment: Any, out: Any = None, progress: Any = None) -> Any:
    """Run an experiment, or go on with one that was stopped, and return its `Results`.

    experiment: an `Experiment`, a path of an experiment file, or a dict with the keys of one, whose `system` may be a
        `System` or `DiscreteSystem` of your own.
    out: folder of results (default "results"). progress: called with (runs done, runs in all).
    Raises `ConfigError` before anything is computed, `LockedError` where another process runs the same experiment,
    `EnvironmentFault` for disk and memory, `Interrupted` after Ctrl-C with everything so far saved.
    """
    from nlbench.engine.driver import run

    return run(*_stated(experiment), "results" if out is None else out, progress)


def plan(experiment: Any) -> dict[str, Any]:
    """What a run would cost: blocks, steps, seconds, bytes of memory and of disk."""
    from nlbench.engine.estimate import plan

    return plan(*_stated(experiment))


def check(experiment: Any) -> None:
    """Raises `ConfigError` with what only shows when systems and filters are made, such as shapes that do not fit."""
    from nlbench.engine.problem import make

    make(*_stated(experiment))


def replay(experiment: Any, label: str, trajectory: int) -> Any:
    """One trajectory of one filter in full, as a DataFrame, recomputed with its whole block."""
    from nlbench.engine.trace import replay

    return replay(*_stated(experiment), label, trajectory)


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
