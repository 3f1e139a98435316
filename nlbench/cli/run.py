"""`nlbench run`: compute an experiment, write its tables and report, print the essence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import budget, options, output
from nlbench.errors import ConfigError

if TYPE_CHECKING:
    from nlbench.cli.progress import Progress
    from nlbench.config import Experiment
    from nlbench.config.precision import Precision


def run(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    out: options.Out = Path("results"),
    gate: Annotated[
        bool, typer.Option("--gate", help="Exit with 3 unless every claim is confirmed.")
    ] = False,
    precision: options.Precision = None,
    limit: budget.Budget = None,
    yes: budget.Yes = False,
    json: options.Json = False,
) -> None:
    """Run an experiment, or go on with one that was stopped.

    What was computed before is kept: a larger --runs tops up, the same command after an interruption goes on.
    """
    with output.errors_as_json(json):
        asked = options.precision(precision, runs)
        longest = None if yes else budget.seconds(limit)
        experiment = options.experiment(config, runs, seed, settings)
        if gate and not experiment.claims:
            raise ConfigError(f"{config}: --gate needs claims, and the file makes none")
        chosen = None
        if asked is not None:
            experiment, chosen = _chosen(experiment, out, asked, longest, quiet=json)
        results = _computed(experiment, out, longest, quiet=json)
        report = _reported(results)
    from nlbench.cli import summary

    facts = summary.facts(experiment, results, report)
    if asked is not None:
        facts["precision"] = summary.precision(asked, chosen, experiment, results)
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


def _chosen(
    experiment: Experiment, out: Path, asked: Precision, longest: float | None, quiet: bool
) -> tuple[Experiment, Any]:
    """The experiment with the runs that the precision needs, and how they were chosen."""
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench.engine.planning.precision import choose

    with _watched(longest, quiet) as show:
        chosen = choose(experiment, asked, out, show)
    counts = experiment.monte_carlo.model_copy(update={"runs": chosen.runs})
    return experiment.model_copy(update={"monte_carlo": counts}), chosen


def _computed(experiment: Experiment, out: Path, longest: float | None, quiet: bool) -> Any:
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench import engine
    from nlbench.engine.planning.space import require

    with _watched(longest, quiet) as show:
        return engine.run(experiment, out, progress=show, check=None if longest is None else require)


@contextmanager
def _watched(longest: float | None, quiet: bool) -> Iterator[Progress | None]:
    """Progress that keeps to the budget, while SIGTERM does what Ctrl-C does."""
    from nlbench.cli.progress import progress
    from nlbench.cli.signals import ended_by_a_second, terminated_like_interrupted

    with terminated_like_interrupted(), ended_by_a_second(), progress(quiet) as show:
        yield show if longest is None else budget.Guard(longest, show)


def _reported(results: Any) -> Path:
    from nlbench import report

    return Path(report.write(results))
