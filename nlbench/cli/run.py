"""`nlbench run`: compute an experiment, write its tables and report, print the essence."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError


def run(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    out: options.Out = Path("results"),
    gate: Annotated[
        bool, typer.Option("--gate", help="Exit with 3 unless every claim is confirmed.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Run an experiment, or go on with one that was stopped.

    What was computed before is kept: a larger --runs tops up, the same command after an interruption goes on.
    """
    experiment = options.experiment(config, runs, seed, settings)
    if gate and not experiment.claims:
        raise ConfigError(f"{config}: --gate needs claims, and the file makes none")
    results = _computed(experiment, out, quiet=json)
    report = _reported(results)
    from nlbench.cli import summary

    facts = summary.facts(experiment, results, report)
    faults = summary.faults(experiment, facts, gate)
    if json:
        output.as_json({**facts, "exit_code": faults[0].exit_code if faults else 0})
    else:
        summary.show(experiment, facts)
        output.next_step(f"open {report}", "all figures and tables on one page; it needs no network")
    if faults:
        for each in faults[1:]:
            output.complain(str(each))
        raise faults[0]


def _computed(experiment: Any, out: Path, quiet: bool) -> Any:
    from nlbench import runtime
    from nlbench.cli.progress import progress
    from nlbench.cli.signals import terminated_like_interrupted

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench import engine

    with terminated_like_interrupted(), progress(quiet) as show:
        return engine.run(experiment, out, progress=show)


def _reported(results: Any) -> Path:
    from nlbench import report

    return Path(report.write(results))
