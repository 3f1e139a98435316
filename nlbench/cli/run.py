"""`nlbench run`: compute an experiment, write its tables and report, print the essence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from nlbench.cli import merge, options, output
from nlbench.errors import ConfigError


def run(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    out: options.Out = Path("results"),
    gate: options.Gate = False,
    dask: Annotated[
        str | None,
        typer.Option(
            "--dask",
            metavar="ADDRESS",
            help="Compute with the workers of a dask scheduler (tcp://HOST:PORT), or with N processes (local:N).",
        ),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option("--shard", metavar="I/N", help="Only part I of N; `merge` makes the run of them."),
    ] = None,
    json: options.Json = False,
) -> None:
    """Run an experiment, or go on with one that was stopped.

    What was computed before is kept: a larger --runs tops up, the same command after an interruption goes on.
    """
    experiment = options.experiment(config, runs, seed, settings)
    if shard is not None:
        if dask or gate:
            raise ConfigError("--shard goes neither with --dask nor with --gate, which is for `merge`")
        division, stated = merge.divided(shard), [("--runs", runs), ("--seed", seed), ("--from", str(out))]
        words = [word for name, value in stated if value is not None for word in (name, value)]
        command = options.command("merge", config, settings, *words)
        merge.shard(experiment, division, out, json, computing, command)
        return
    if dask is not None:
        from nlbench.engine.cluster import checked

        checked(dask)

    def computed(show: Any) -> Any:
        from nlbench import engine

        return engine.run(experiment, out, progress=show, dask=dask)

    finished(config, experiment, lambda: computing(experiment, json, computed), gate, json)


def finished(config: Path, experiment: Any, compute: Callable[[], Any], gate: bool, json: bool) -> None:
    """Compute, report and print the essence; raises the gravest of what makes the command fail."""
    if gate and not experiment.claims:
        raise ConfigError(f"{config}: --gate needs claims, and the file makes none")
    results = compute()
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


def computing(experiment: Any, quiet: bool, compute: Callable[[Any], Any]) -> Any:
    """What `compute` gives, called with a function that shows progress, when jax is set up for the experiment."""
    from nlbench import runtime
    from nlbench.cli.progress import progress
    from nlbench.cli.signals import terminated_like_interrupted

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    with terminated_like_interrupted(), progress(quiet) as show:
        return compute(show)


def _reported(results: Any) -> Path:
    from nlbench import report

    return Path(report.write(results))
