"""`nlbench filter`: the filters of an experiment along measurements that were recorded in a CSV file."""

from __future__ import annotations

import math
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import options, output, recording
from nlbench.errors import LimitError, Problems
from nlbench.results.reasons import left_out

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.config.recording import Recording


def filter_recorded(
    config: options.Config,
    data: Annotated[
        Path,
        typer.Argument(metavar="DATA", help="Measurements (CSV with a header line).", show_default=False),
    ],
    labels: Annotated[
        list[str] | None,
        typer.Option("--filter", metavar="LABEL", help="A filter of the file; repeatable. Default: all."),
    ] = None,
    time: Annotated[str, typer.Option("--time", metavar="NAME", help="Column of the times.")] = "time",
    measured: Annotated[
        str | None,
        typer.Option(
            "--measured",
            metavar="NAMES",
            help="Columns of the measurements in the system's order: a,b. Default: all but the time.",
        ),
    ] = None,
    start: Annotated[float, typer.Option("--start", metavar="T", help="Time of the initial moments.")] = 0.0,
    seed: options.Seed = None,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Write the CSV here instead of printing it.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Run filters on your own recorded data.

    System, parameters, initial moments and filters are those of CONFIG. DATA has a column of times (step numbers where
    time is discrete) and one for each measurement; empty or NaN: not measured. The estimates come out as CSV, a summary
    on stderr, and a warning where the first row lies far after the start.
    """
    names = None if measured is None else [name.strip() for name in measured.split(",")]
    problems = Problems()
    with problems.of(""):
        recording.check_out(out, config, data)
    with problems.of(""):
        experiment, recorded = recording.read(config, seed, settings, data, time, names)
        with problems.of(""):
            chosen = recording.chosen(experiment, labels)
        with problems.of(""):
            recording.check_start(experiment, recorded, start, time)
    problems.refuse()
    found = _filtered(experiment, chosen, recorded, start)
    frame = _joined(found)
    facts = _facts(experiment, recorded, found, out)
    if facts["warning"] and not json:
        output.complain(f"warning: {facts['warning']}")
    lost = [
        f"FAILED: {each['filter']}: no finite estimate from {data}:{each['lost_line']} on; first {each['reason']}"
        for each in facts["filters"]
        if each["lost_line"] is not None
    ]
    faults = [LimitError("\n".join(lost))] if lost else []
    if out is not None or not json:
        _write(frame, out)
    if json:
        estimates = {} if out is not None else {"estimates": frame.to_dict(orient="records")}
        output.as_json({**facts, **estimates}, *faults)
    else:
        # The estimates have stdout to themselves, so that they can be piped.
        with redirect_stdout(sys.stderr):
            _show(facts)
            given = {
                "--filter": labels,
                "--time": time,
                "--measured": measured,
                "--start": start,
                "--seed": seed,
            }
            _next(config, data, settings, given, out)
    if faults:
        raise faults[0]


def _filtered(experiment: Experiment, labels: list[str], recorded: Recording, start: float) -> list[Any]:
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench.engine.recorded import filtered

    return list(filtered(experiment, labels, recorded, start))


def _joined(found: list[Any]) -> Any:
    """One table of all filters, headed by the filter's label."""
    import pandas as pd

    tables = [each.table.copy() for each in found]
    for each, table in zip(found, tables, strict=True):
        table.insert(0, "filter", each.label)
    return pd.concat(tables, ignore_index=True)


def _write(frame: Any, out: Path | None) -> None:
    from nlbench.results.atomic import atomic_write
    from nlbench.results.tables import csv_bytes

    if out is not None:
        atomic_write(out, csv_bytes(frame))
    else:
        sys.stdout.write(csv_bytes(frame).decode())


def _facts(experiment: Experiment, recorded: Recording, found: list[Any], out: Path | None) -> dict[str, Any]:
    """What `--json` prints, and what the summary shows."""
    filters = []
    for each in found:
        said = {"filter": each.label, "verdict": each.foretold.verdict, **each.foretold._asdict()}
        lost = said.pop("lost")
        filters.append({**said, "lost_line": None if lost is None else recorded.lines[lost]})
    return {
        "experiment": experiment.experiment,
        "data": recorded.file,
        "rows": len(recorded.times),
        "missing": sum(math.isnan(value) for value in recorded.values),
        "warning": f"{recorded.file}: {found[0].doubt}" if found[0].doubt else None,
        "out": None if out is None else str(out),
        "filters": filters,
    }


def _show(facts: dict[str, Any]) -> None:
    """The summary, within 80 columns where the labels allow it."""
    print(f"{facts['data']}: {facts['rows']:,} rows; measurements missing: {facts['missing']:,}\n")
    table = [["filter", "log-likelihood", "mean NIS", "expected", "95 % bounds", "verdict"]]
    for each in facts["filters"]:
        bounds = f"{each['low']:.3f} .. {each['high']:.3f}" if math.isfinite(each["low"]) else "none"
        numbers = (f"{each['nis']:.3f}", f"{each['expected']:.3f}", bounds)
        table.append([each["filter"], f"{each['log_likelihood']:.2f}", *numbers, each["verdict"]])
    output.rows(table)
    for each in facts["filters"]:
        counts = {"limited_or_guarded": each["altered"], "invalid": each["invalid"]}
        if sum(counts.values()):
            of = f"of {sum(counts.values()) + each['samples']:,} updates"
            print(f"\n{each['filter']}: {left_out(counts)} {of}, so its NIS has no bounds")
        if each["lost_line"] is None and not math.isfinite(each["log_likelihood"]):
            print(f"\n{each['filter']}: its density was not positive at some measurement")
    if facts["out"]:
        print(f"\nestimates  {facts['out']}")


def _next(
    config: Path, data: Path, settings: list[str] | None, given: dict[str, Any], out: Path | None
) -> None:
    """given: values of the other options."""
    if out is not None:
        simulated = options.command("run", config, settings)
        output.next_step(simulated, "says how good these filters are, on simulated data")
        return
    defaults = {"--time": "time", "--start": 0.0}
    words = [str(data)]
    for option, value in given.items():
        for each in value if isinstance(value, list) else [value]:
            words += [option, str(each)] if each not in (None, defaults.get(option)) else []
    again = options.command("filter", config, settings, *words, "--out", f"{data.stem}-filtered.csv")
    output.next_step(again, "keeps the estimates in a file")
