"""What `plan` prints: counts, then time, memory and disk by part."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from nlbench.cli import output

if TYPE_CHECKING:
    from nlbench.config import Experiment

TITLES = {
    "start": "imports, the problem",
    "compile": "compile (from the cache)",
    "bounds": "bounds",
    "run": "run",
    "cost_table": "cost table",
    "tables": "tables",
    "figures_and_report": "figures, report",
    "process": "program and libraries",
    "calls": "calls at the same time",
    "totals": "totals, kept runs",
    "finishing": "saving, tables",
    "libraries": "tables and figures",
    "checkpoint": "checkpoint",
    "checkpoint_replaced": "its replacement",
    "kept_runs": "table of kept runs",
    "total": "total",
}


def show(experiment: Experiment, cost: Mapping[str, Any]) -> None:
    """Print a plan within 80 columns."""
    print(f"{experiment.experiment}, {cost['runs']:,} runs")
    output.definitions(_counts(cost))
    _parts("time", cost["seconds"], output.duration)
    _parts("memory", cost["memory_bytes"], output.size, cost["memory_free_bytes"])
    _parts("disk", cost["disk_bytes"], output.size, cost["disk_free_bytes"])


def _counts(cost: Mapping[str, Any]) -> list[tuple[str, str]]:
    filters, runs, steps = len(cost["filters"]), cost["runs"], cost["steps_per_run"]
    product = f"{filters} x {runs:,} x {steps:,} = {cost['filter_steps']:,}"
    found = [("filters", ", ".join(cost["filters"])), ("filters x runs x steps", product)]
    if "measurements_per_run" in cost:
        found.append(("measurements per run", f"{cost['measurements_per_run']:,}"))
    else:
        found.append(("sightings per run, at most", f"{cost['most_sightings_per_run']:,}"))
    if cost["runs_done"]:
        found.append(("done already", f"{cost['runs_done']:,} runs; what follows is for the rest"))
    if "precision" in cost:
        found.append(("precision", _precision(cost["precision"])))
    return [*found, ("threads", str(cost["threads"]))]


def _precision(chosen: Mapping[str, Any]) -> str:
    left_out = f"; without a usable value: {', '.join(chosen['left_out'])}" if chosen["left_out"] else ""
    worst = f"{chosen['filter']}, {chosen['coordinate']} at t = {chosen['time']:g}"
    return (
        f"{chosen['asked']} needs {chosen['runs']:,} runs; {chosen['pilot']:,} runs give "
        f"{output.percent(chosen['share'])} % at worst ({worst}){left_out}"
    )


def _parts(
    title: str, parts: Mapping[str, float], words: Callable[[float], str], free: float | None = None
) -> None:
    print(f"\n{title}")
    output.rows([TITLES.get(name, name), words(value)] for name, value in parts.items() if value)
    if free is not None and parts["total"] > free:
        output.rows([[output.styled("MORE THAN IS FREE", "red"), words(free)]])
