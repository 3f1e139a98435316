"""`nlbench report` and `replay`: what a finished run can still show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError


def report(
    where: options.Where,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    out: options.Out = Path("results"),
) -> None:
    """Draw figures and write the report from saved tables."""
    folder = found(where, settings, out)
    from nlbench import report as reports
    from nlbench.errors import DamagedResults
    from nlbench.results.folder import RunFolder
    from nlbench.results.results import Results

    RunFolder(folder).check_finished()
    if faults := Results(folder).damaged():
        raise DamagedResults("\n".join(faults))
    page = reports.write(Results(folder))
    print(f"report  {page}")
    output.next_step(f"open {page}", "all figures and tables on one page; it needs no network")


def found(where: Path, settings: list[str] | None, out: Path) -> Path:
    """The folder of a run, given by itself or by its experiment file. Raises `ConfigError` where there is none."""
    if not where.exists():
        raise ConfigError(f"{where}: no such folder of a run, and no such experiment file")
    if where.is_dir():
        return where
    folder = options.experiment(where, None, None, settings, computes=False).folder(out)
    if not folder.is_dir():
        first = options.command("run", where, settings)
        raise ConfigError(f"{where}: no results in {folder}; make them with: {first}")
    return folder


def replay(
    config: options.Config,
    label: Annotated[str, typer.Option("--filter", metavar="LABEL", help="Label of a filter in the file.")],
    trajectory: Annotated[
        int, typer.Option("--trajectory", metavar="N", min=0, help="Number of the run, from 0.")
    ],
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Write a CSV file instead of printing.")
    ] = None,
    json: options.Json = False,
) -> None:
    """Show one run of one filter, step by step."""
    experiment = options.experiment(config, runs, seed, settings, computes=False)
    if label not in experiment.labels:
        from nlbench.suggestions import suggestion

        raise ConfigError(f"--filter: no filter is labelled '{label}'{suggestion(label, experiment.labels)}")
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench import engine

    frame = engine.replay(experiment, label, trajectory)
    if csv is not None:
        from nlbench.results.atomic import atomic_write
        from nlbench.results.tables import csv_bytes

        atomic_write(csv, csv_bytes(frame))
        print(f"{csv}: {len(frame):,} rows")
    elif json:
        output.as_json(frame.to_dict(orient="records"))
        return
    else:
        print(frame.to_string(index=False, line_width=output.WIDTH))
    given = {"--filter": label, "--trajectory": str(trajectory + 1), "--runs": runs, "--seed": seed}
    other = options.command("replay", config, settings, *options.words(given))
    output.next_step(other, "shows the next run")
