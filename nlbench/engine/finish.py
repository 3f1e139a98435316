"""The end of a run: tables, claims, traces, costs and the manifest; and reading finished tables by other claims."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from nlbench.engine.compiled import Compiled
from nlbench.engine.cost import cost_table
from nlbench.engine.failure import failures
from nlbench.engine.resume import device, numerics
from nlbench.engine.trace import trace_tables
from nlbench.errors import Interrupted
from nlbench.results.atomic import remove
from nlbench.results.folder import TABLES, RunFolder
from nlbench.results.manifest import commit, versions
from nlbench.results.reasons import failed, rms_rows
from nlbench.results.results import Results
from nlbench.statistics.claims import judged
from nlbench.statistics.consistency import consistency_table, left_out_table
from nlbench.statistics.sets import KeptTable
from nlbench.statistics.summary import tables
from nlbench.statistics.totals import Totals

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.engine.problem import Problem

OWN_FACTS = ("schema", "checksums", "runs")  # of a manifest: what writing it adds


def complete(folder: RunFolder, experiment: Experiment) -> bool:
    """Whether a finished run has what may be asked for without changing its hash: the same traces, and costs."""
    results = Results(folder.path)
    costed = "cost" in results.tables or not experiment.engine.cost
    return costed and results.experiment.traces == experiment.traces


def read_anew(folder: RunFolder, experiment: Experiment) -> None:
    """Judge a finished run anew from its tables where its claims, or what else says how to read it, have changed."""
    results = Results(folder.path)
    saved = results.experiment
    experiment = experiment.model_copy(update={"monte_carlo": saved.monte_carlo, "engine": saved.engine})
    if saved == experiment:
        return
    made = {name: results.table(name) for name in results.tables}
    facts = {key: value for key, value in results.manifest.items() if key not in OWN_FACTS}
    clip = {name: math.inf if bound is None else bound for name, bound in facts["clip"].items()}
    folder.reopen()
    folder.write_experiment(experiment.resolved_yaml())
    _remove(folder, "claims", "sets")
    folder.write_tables(_judged(experiment, made, clip, facts["norms"]))
    stay = [name for name in results.manifest["checksums"] if name.startswith(f"{TABLES}/")]
    folder.finish(results.manifest["runs"], stay, **facts)


def _judged(
    experiment: Experiment,
    tables: dict[str, pd.DataFrame],
    clip: dict[str, float],
    norms: dict[str, list[str]],
) -> dict[str, pd.DataFrame]:
    """The tables of claims, if there are claims."""
    if not experiment.claims:
        return {}
    return judged(experiment.claims, tables, KeptTable(tables["runs"], clip, norms), experiment.source.runs)


def _remove(folder: RunFolder, *names: str) -> None:
    """Remove tables that the run no longer has."""
    for name in names:
        for left in (folder.path / TABLES).glob(f"{name}.*"):
            remove(left)


def of_totals(problem: Problem, totals: Totals) -> dict[str, pd.DataFrame]:
    """The tables that follow from the totals alone."""
    made = tables(totals)
    made["consistency"] = consistency_table(totals, made["statistics"], problem.truth.measurements)
    left_out = left_out_table(totals)
    return made | ({"left_out": left_out} if len(left_out) else {})


def _go_on(stopped: Callable[[], bool]) -> None:
    if stopped():
        raise Interrupted(
            "stopped before the tables were written; all runs are saved, and the same command goes on from there"
        )


def write(
    folder: RunFolder,
    experiment: Experiment,
    compiled: Compiled,
    totals: Totals,
    seconds: float,
    threads: int,
    stopped: Callable[[], bool],
    bounds: pd.DataFrame | None = None,
) -> None:
    """Write everything that a finished run leaves, the mark that it is done last.

    Raises `Interrupted` before a part that takes long where the run is to stop; all its runs are saved by now.
    """
    problem = compiled.problem
    made = of_totals(problem, totals)
    if bounds is not None:
        made["bounds"] = bounds
    layout = problem.layout
    clip = dict(zip(layout.magnitudes, layout.magnitude_clip, strict=True))
    norms = {name: [layout.coordinates[i] for i in members] for name, members in layout.norms.items()}
    made |= _judged(experiment, made, clip, norms)
    rms = rms_rows(made["statistics"], experiment.report_times)
    if lost := failed(made["divergence"].to_dict(orient="records"), rms):
        _go_on(stopped)
        made["failures"] = failures(problem, experiment.monte_carlo.seed, totals.runs, lost)
    if experiment.traces:
        _go_on(stopped)
        made |= trace_tables(compiled, experiment.traces, threads)
    if experiment.engine.cost:
        _go_on(stopped)
        made["cost"] = cost_table(problem, experiment.monte_carlo.seed, threads)
    _go_on(stopped)
    _remove(folder, "traces", "responses", "claims", "sets", "cost", "left_out", "failures")
    folder.write_tables(made)
    folder.finish(
        totals.runs,
        experiment=experiment.experiment,
        hash=experiment.hash12(),
        seed=experiment.monte_carlo.seed,
        block=problem.block,
        precision=experiment.engine.precision,
        threads=threads,
        units=layout.magnitude_units,
        clip={name: bound if math.isfinite(bound) else None for name, bound in clip.items()},
        norms=norms,
        versions=versions(),
        commit=commit(),
        device=device(),
        fingerprint=numerics(compiled),
        finished=datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        seconds=round(seconds, 3),
        compile_seconds=round(compiled.seconds, 3),
    )
