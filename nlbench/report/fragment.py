"""The essence of a run as a fragment of HTML, for a cell of a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.figures.data import read
from nlbench.report import tables
from nlbench.report.template import render

if TYPE_CHECKING:
    from nlbench.results.results import Results


def brief(results: Results) -> str:
    """Question, errors at the report times, diverged runs and verdicts; everything is escaped."""
    data, experiment = read(results), results.experiment
    statistic = "rms_clipped" if data.any_diverged else "rms"
    shown = [*tables.errors(data, statistic, experiment.report_times), tables.divergence(data)]
    if "claims" in results.tables:
        shown.append(tables.claims(results.table("claims")))
    return render(
        "report/brief.html",
        question=experiment.question or experiment.experiment,
        facts=f"{experiment.system.name}, {data.runs:,} runs, seed {experiment.monte_carlo.seed}",
        tables=shown,
        path=str(results.path),
    )
