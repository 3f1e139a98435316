"""`nlbench run`: compute an experiment, write its tables and report, print the essence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import budget, merge, options, output
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.config.precision import Precision
    from nlbench.engine.shards import Done


def run(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    out: options.Out = Path("results"),
    gate: options.Gate = False,
    precision: options.Precision = None,
    limit: budget.Budget = None,
    yes: budget.Yes = False,
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
    asked = options.precision(precision, runs)
    longest = None if yes else budget.seconds(limit)
    experiment = options.experiment(config, runs, seed, settings)
    if shard is not None:
        if dask or gate or asked:
            raise ConfigError("--shard goes with none of --dask, --precision and --gate")
        done = _shard(experiment, merge.divided(shard), out, longest, quiet=json)
        merge.show_shard(done, config, {"--runs": runs, "--seed": seed, "--from": str(out)}, settings, json)
        return
    gated(config, experiment, gate)
    if dask is not None:
        from nlbench.engine.cluster import checked

        checked(dask)
    if asked is not None:
        experiment, runs_chosen = _chosen(experiment, out, asked, longest, quiet=json)

    def computed(show: Any) -> Any:
        from nlbench import engine

        return engine.run(experiment, out, progress=show, check=_check(longest), dask=dask)

    results = computing(experiment, json, computed, longest)
    chosen: dict[str, Any] = {}
    if asked is not None:
        from nlbench.cli import summary

        chosen = {"precision": summary.precision(asked, runs_chosen, experiment, results)}
    finish(experiment, results, gate, json, chosen)


def _check(longest: float | None) -> Any:
    """What is looked at before anything is computed, unless the user said --yes."""
    from nlbench.engine.planning.space import require

    return None if longest is None else require


def _shard(
    experiment: Experiment, division: tuple[int, int], out: Path, longest: float | None, quiet: bool
) -> Done:
    """One shard, computed."""

    def computed(show: Any) -> Any:
        from nlbench.engine.shards import run_shard

        return run_shard(experiment, *division, out, show, _check(longest))

    return computing(experiment, quiet, computed, longest)


def gated(config: Path, experiment: Experiment, gate: bool) -> None:
    """Raise `ConfigError` where claims are to be a gate and there are none."""
    if gate and not experiment.claims:
        raise ConfigError(f"{config}: --gate needs claims, and the file makes none")


def finish(
    experiment: Experiment, results: Any, gate: bool, json: bool, more: dict[str, Any] | None = None
) -> None:
    """Report and print the essence, and `more` facts; raises the gravest of what makes the command fail."""
    report = _reported(results)
    from nlbench.cli import summary

    facts = {**summary.facts(experiment, results, report), **(more or {})}
    faults = summary.faults(experiment, facts, gate)
    if json:
        output.as_json({**facts, "exit_code": faults[0].exit_code if faults else 0}, *faults)
    else:
        summary.show(experiment, facts)
        output.next_step(f"open {report}", "all figures and tables on one page; it needs no network")
    if faults:
        for each in faults[1:]:
            output.complain(str(each))
        raise faults[0]


def _chosen(
    experiment: Experiment, out: Path, asked: Precision, longest: float | None, quiet: bool
) -> tuple[Experiment, Any]:
    """The experiment with the runs that the precision needs, and how they were chosen."""

    def choose(show: Any) -> Any:
        from nlbench.engine.planning.precision import choose

        return choose(experiment, asked, out, show, _check(longest))

    chosen = computing(experiment, quiet, choose, longest)
    return experiment.of_runs(chosen.runs), chosen


def computing(
    experiment: Experiment, quiet: bool, compute: Callable[[Any], Any], longest: float | None = None
) -> Any:
    """What `compute` gives, called with a function that shows progress and keeps to the budget, with jax set up for
    the experiment; a second signal ends the process."""
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench.cli.progress import progress
    from nlbench.cli.signals import ended_by_a_second

    with ended_by_a_second(), progress(quiet) as show:
        return compute(show if longest is None else budget.Guard(longest, show))


def _reported(results: Any) -> Path:
    from nlbench import report

    return Path(report.write(results))
