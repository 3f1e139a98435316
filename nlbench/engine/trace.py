"""One trajectory of one filter in full, recomputed with its block by the same compiled function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.checks import known
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make, state_names
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.systems.system import System


def replay(experiment: Experiment, own: System | None, label: str, trajectory: int) -> pd.DataFrame:
    """Output times as rows: truth, mean, variance and third moment of each state, the measurement taken at that time
    (NaN where none was), whether diverged.

    Raises `ConfigError` for an unknown label or a trajectory that the experiment does not have.
    """
    import pandas as pd

    known(label, experiment.labels, what="filter")
    if not 0 <= trajectory < experiment.monte_carlo.runs:
        raise ConfigError(f"trajectory {trajectory} is not one of 0 ... {experiment.monte_carlo.runs - 1}")
    problem = make(experiment, own)
    compiled = compile_chunks(problem, experiment.monte_carlo.seed)
    view = compiled.view(trajectory)
    number = experiment.labels.index(label)
    n = problem.truth.states
    names = state_names(n)
    components, layout = view.components[number], problem.layout
    columns: dict[str, Any] = {"time": layout.times}
    for i, name in enumerate(names):
        columns[f"{name}_truth"] = view.truth[:, i]
        columns[f"{name}_mean"] = components[:, i]
        columns[f"{name}_variance"] = components[:, n + _place(n, 2, i)]
        if components.shape[1] > n + n * (n + 1) // 2:
            columns[f"{name}_third"] = components[:, n + n * (n + 1) // 2 + _place(n, 3, i)]
    taken = {
        round(t, 9): y for t, y in zip(problem.schedule.measurement_times, view.measurements, strict=True)
    }
    for r in range(problem.truth.measurements):
        nothing = np.full(problem.truth.measurements, np.nan)
        columns[f"y{r + 1}"] = [taken.get(round(t, 9), nothing)[r] for t in layout.times]
    columns["diverged"] = view.diverged[number]
    return pd.DataFrame(columns)


def _place(n: int, order: int, i: int) -> int:
    """Where the component (i, ..., i) stands among the unique ones."""
    from nlbench.algebra import compact_address

    return compact_address((i + 1,) * order, n) - 1
