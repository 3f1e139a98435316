"""Single trajectories in full, each recomputed with its block by the same compiled function."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.algebra import compact_address
from nlbench.checks import known
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.systems.system import state_names

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.engine.block import View
    from nlbench.engine.compiled import Compiled
    from nlbench.engine.problem import Problem
    from nlbench.statistics.layout import Layout
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

MOST_MEASUREMENTS = 500  # of a run in `responses`: a continuous measurement has one for each step


def replay(
    experiment: Experiment, own: System | DiscreteSystem | None, label: str, trajectory: int
) -> pd.DataFrame:
    """Output times as rows. Of each error: its value and the standard deviation that the filter states; of each state:
    the truth, and the filter's mean, variance and third moment; the measurement taken at that time (NaN where none
    was), where times are fixed; whether diverged.

    Raises `ConfigError` for an unknown label or a trajectory that the experiment does not have.
    """
    import pandas as pd

    known(label, experiment.labels, what="filter")
    if not 0 <= trajectory < experiment.monte_carlo.runs:
        most = experiment.monte_carlo.runs - 1
        raise ConfigError(
            f"trajectory {trajectory} is not one of 0 ... {most}, as many as monte_carlo.runs says"
        )
    problem = make(experiment, own)
    view = compile_chunks(problem, experiment.monte_carlo.seed).view(trajectory)
    number = experiment.labels.index(label)
    columns: dict[str, Any] = {"time": problem.layout.times}
    for place, name in enumerate(problem.layout.coordinates):
        columns[f"{name}_error"] = view.error[number][:, place]
        columns[f"{name}_deviation"] = deviation(view.variance[number][:, place])
    columns.update(_states(problem, view, number))
    if problem.schedule.measurements:
        columns.update(_measurements(problem, view))
    columns["diverged"] = view.diverged[number]
    return pd.DataFrame(columns)


def trace_tables(compiled: Compiled, trajectories: Sequence[int], threads: int) -> dict[str, pd.DataFrame]:
    """The tables of single trajectories: `traces`, and `responses` where states have names that all filters share."""
    with ThreadPoolExecutor(threads) as pool:
        views = list(pool.map(compiled.view, trajectories))
    problem = compiled.problem
    models = [problem.truth, *(runner.filter.system for runner in problem.runners)]
    made = {"traces": traces(problem.layout, trajectories, views)}
    named = len(problem.layout.coordinates)
    if all(model.error is None and model.states == named for model in models):
        made["responses"] = responses(problem, trajectories, views)
    return made


def traces(layout: Layout, trajectories: Sequence[int], views: Sequence[View]) -> pd.DataFrame:
    """`trajectory, filter, time, coordinate, error, deviation, diverged` of all filters at all output times.

    error is truth minus estimate, deviation the standard deviation that the filter states for it: NaN where its
    variance is negative.
    """
    import pandas as pd

    error, variance = (
        np.array([getattr(view, part) for view in views], float) for part in ("error", "variance")
    )
    diverged = np.broadcast_to(np.array([view.diverged for view in views])[..., None], error.shape)
    names = (trajectories, layout.filters, layout.times, layout.coordinates)
    labels = {
        column: np.array(name, object if column in ("filter", "coordinate") else None)[index.ravel()]
        for column, name, index in zip(
            ("trajectory", "filter", "time", "coordinate"), names, np.indices(error.shape), strict=True
        )
    }
    values = {"error": error, "deviation": deviation(variance), "diverged": diverged}
    return pd.DataFrame({**labels, **{column: value.ravel() for column, value in values.items()}})


def responses(problem: Problem, trajectories: Sequence[int], views: Sequence[View]) -> pd.DataFrame:
    """`trajectory, kind, filter, name, time, value`.

    kind `truth` and `estimate`: states by name at all output times, an estimate with its filter. kind `measurement`:
    `y1` and so on, made at fixed times; every second, third ... where there would be too many.
    """
    import pandas as pd

    layout, measured = problem.layout, problem.schedule.measurement_times
    every = max(1, -(-len(measured) // MOST_MEASUREMENTS))
    ys = tuple(f"y{r + 1}" for r in range(problem.truth.measurements))
    parts = []
    for trajectory, view in zip(trajectories, views, strict=True):
        series = [("truth", "", layout.coordinates, layout.times, view.truth)]
        for label, runner, components in zip(layout.filters, problem.runners, view.components, strict=True):
            estimate = components[:, : runner.filter.system.states]
            series.append(("estimate", label, layout.coordinates, layout.times, estimate))
        if measured:
            series.append(("measurement", "", ys, measured[::every], view.measurements[::every]))
        for kind, label, names, times, values in series:
            for name, value in zip(names, np.asarray(values, float).T, strict=True):
                labels = {"trajectory": trajectory, "kind": kind, "filter": label, "name": name}
                parts.append(pd.DataFrame({**labels, "time": times, "value": value}))
    return pd.concat(parts, ignore_index=True)


def deviation(variance: np.ndarray) -> np.ndarray:
    """Standard deviations; NaN for a negative variance, which a filter may state."""
    with np.errstate(invalid="ignore"):
        return np.sqrt(variance)


def _states(problem: Problem, view: View, number: int) -> dict[str, np.ndarray]:
    """True states, and a filter's own moments of each of its states, which may be others than those of the truth."""
    model, components = problem.runners[number].filter.system, view.components[number]
    n = model.states
    after_cov = n + n * (n + 1) // 2
    columns = {f"{name}_truth": view.truth[:, i] for i, name in enumerate(_names(problem, problem.truth))}
    for i, name in enumerate(_names(problem, model)):
        columns[f"{name}_mean"] = components[:, i]
        columns[f"{name}_variance"] = components[:, n + compact_address((i + 1,) * 2, n) - 1]
        if components.shape[1] > after_cov:
            columns[f"{name}_third"] = components[:, after_cov + compact_address((i + 1,) * 3, n) - 1]
    return columns


def _names(problem: Problem, system: System | DiscreteSystem) -> Sequence[str]:
    """Names of the states: those of the errors, where these are plain differences of states."""
    return problem.layout.coordinates if system.error is None else state_names(system.states)


def _measurements(problem: Problem, view: View) -> dict[str, np.ndarray]:
    """The measurements made at fixed times, NaN at the other output times."""
    taken = {
        round(t, 9): y for t, y in zip(problem.schedule.measurement_times, view.measurements, strict=True)
    }
    nothing = np.full(problem.truth.measurements, np.nan)
    rows = np.array([taken.get(round(t, 9), nothing) for t in problem.layout.times])
    return {f"y{r + 1}": rows[:, r] for r in range(problem.truth.measurements)}
