"""What stands on the page, gathered from the results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from nlbench.figures import bands, data
from nlbench.report import tables, winners
from nlbench.report.moments import moments
from nlbench.report.numbers import duration, measured, percent, plain
from nlbench.report.pictures import embedded
from nlbench.results.reasons import told

if TYPE_CHECKING:
    from nlbench.results.results import Results


def contents(results: Results, drawn: list[Path]) -> dict[str, Any]:
    """Variables of the page's template."""
    read = data.read(results)
    experiment = results.experiment
    statistic = "rms_clipped" if read.any_diverged else "rms"
    found = winners.winners(read, statistic)
    last = max((winner.time for winner in found), default=0.0)
    optional = {
        name: results.table(name)
        for name in ("claims", "sets", "cost", "moments", "failures")
        if name in results.tables
    }
    return {
        "question": experiment.question or experiment.experiment,
        "experiment": experiment.experiment,
        "answers": [winners.sentences(winner, read) for winner in found if winner.time == last],
        "source": _source(read, experiment, statistic),
        "summary": _summary(results),
        "claims": tables.claims(optional["claims"]) if len(optional.get("claims", ())) else None,
        "sets": tables.sets(optional["sets"], experiment.source.runs)
        if len(optional.get("sets", ()))
        else None,
        "best": tables.best(found, read) if found and len(read.filters) > 1 else None,
        "errors": [
            table
            for name in dict.fromkeys([statistic, "rms"])
            for table in tables.errors(read, name, experiment.report_times)
        ],
        "any_diverged": read.any_diverged,
        "divergence": tables.divergence(read),
        "failures": [(row["filter"], told(row)) for row in optional["failures"].to_dict("records")]
        if "failures" in optional
        else [],
        "consistency": tables.consistency(read, experiment.report_times),
        "cost": tables.cost(optional["cost"]) if "cost" in optional else None,
        "figures": embedded(drawn),
        "moments": moments(optional["moments"], read) if "moments" in optional else None,
        "parameters": experiment.resolved_yaml(),
        "environment": _environment(results.manifest),
        "files": [link(results, path) for path in _files(results)],
        "link": lambda path: link(results, path),
    }


def link(results: Results, path: Path) -> dict[str, str]:
    """A file of the run's folder, relative to the page."""
    name = path.relative_to(results.path).as_posix()
    return {"name": name, "address": quote(name), "kind": path.suffix.removeprefix(".").upper()}


def _files(results: Results) -> list[Path]:
    found = [
        *sorted((results.path / "tables").glob("*.csv")),
        *sorted((results.path / "tables").glob("*.parquet")),
    ]
    return [*found, *(results.path / name for name in ("config.resolved.yaml", "manifest.json"))]


def _summary(results: Results) -> list[tuple[str, str]]:
    """Facts of the card at the top."""
    manifest, experiment = results.manifest, results.experiment
    return [
        ("runs", f"{manifest['runs']:,}"),
        ("seed", str(manifest["seed"])),
        ("system", experiment.system.name),
        ("computing time", duration(manifest["seconds"])),
        ("finished", manifest["finished"].replace("T", " ").replace("+00:00", " UTC")),
        ("results", manifest["hash"]),
    ]


def _source(read: data.Data, experiment: Any, statistic: str) -> str:
    """What the experiment reproduces, and what that source's number of runs can show."""
    source = experiment.source
    if not source.document:
        return ""
    kinds = {"figures": source.figures, "tables": source.tables}
    parts = [source.document, *(f"{kind} {', '.join(each)}" for kind, each in kinds.items() if each)]
    text = f"After {', '.join(parts)}."
    coordinate = read.coordinates(statistic)[0]
    curve = read.curve(read.baseline, coordinate, statistic)
    if source.runs and curve.value[-1] > 0:
        reach = bands.of_runs(curve, source.runs)[1][-1] / curve.value[-1] - 1
        time = measured(plain(curve.time[-1]), read.units["time"])
        text += f" Of tests with its {source.runs:,} runs, 95\u00a0% would find an error of {coordinate} at t = {time} "
        text += f"within ±\u00a0{percent(reach)}\u00a0% of the one shown here for {read.baseline}: "
        text += "that is the grey band in the figures."
    return text


def _environment(manifest: dict[str, Any]) -> list[tuple[str, str]]:
    """Where the numbers come from: software, hardware, settings."""
    keys = ("device", "precision", "threads", "block", "commit", "seconds", "compile_seconds")
    facts = [(key.replace("_", " "), str(manifest[key])) for key in keys if manifest.get(key) is not None]
    nested = {**manifest.get("versions", {}), **manifest.get("fingerprint", {})}
    return facts + [(key.replace("_", " "), str(value)) for key, value in sorted(nested.items())]
