"""The end of a run: tables, claims, traces, costs and the manifest."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

from nlbench.engine.compiled import Compiled
from nlbench.engine.cost import cost_table
from nlbench.engine.resume import device, numerics
from nlbench.engine.trace import traces
from nlbench.results.atomic import remove
from nlbench.results.folder import TABLES, RunFolder
from nlbench.results.manifest import commit, versions
from nlbench.results.results import Results
from nlbench.statistics.claims import evaluate
from nlbench.statistics.consistency import consistency_table
from nlbench.statistics.summary import tables
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment


def up_to_date(folder: RunFolder, experiment: Experiment) -> bool:
    """Whether the traces of a finished run are those asked for, which may change without changing its hash."""
    return Results(folder.path).experiment.traces == experiment.traces


def write(
    folder: RunFolder,
    experiment: Experiment,
    compiled: Compiled,
    totals: Totals,
    seconds: float,
    threads: int,
    bounds: pd.DataFrame | None = None,
) -> None:
    """Write everything that a finished run leaves, the mark that it is done last."""
    problem = compiled.problem
    made = tables(totals)
    made["consistency"] = consistency_table(totals, made["statistics"], problem.truth.measurements)
    if bounds is not None:
        made["bounds"] = bounds
    if experiment.claims:
        made["claims"] = evaluate(experiment.claims, made["statistics"], made["paired"])
    if experiment.traces:
        made["traces"] = traces(compiled, experiment.traces, threads)
    made["cost"] = cost_table(problem, experiment.monte_carlo.seed)
    for left in (folder.path / TABLES).glob("traces.*"):  # of runs that are no longer traced
        remove(left)
    folder.write_tables(made)
    folder.finish(
        totals.runs,
        experiment=experiment.experiment,
        hash=experiment.hash12(),
        seed=experiment.monte_carlo.seed,
        block=problem.block,
        precision=experiment.engine.precision,
        threads=threads,
        units=problem.layout.magnitude_units,
        versions=versions(),
        commit=commit(),
        device=device(),
        fingerprint=numerics(compiled),
        finished=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        seconds=round(seconds, 3),
        compile_seconds=round(compiled.seconds, 3),
    )
