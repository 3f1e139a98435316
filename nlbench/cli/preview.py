"""`nlbench validate`, `plan` and `doctor`: look before you run."""

from __future__ import annotations

from pathlib import Path

from nlbench.cli import options, output, planned
from nlbench.errors import ConfigError, EnvironmentFault, printable


def validate(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """Check an experiment file; say everything that is wrong with it."""
    try:
        experiment = options.experiment(config, runs, seed, settings)
    except ConfigError as error:
        if json:
            output.as_json({"valid": False, "problems": [each._asdict() for each in error.problems]}, error)
        raise
    if json:
        output.as_json({"valid": True, "hash": experiment.hash12(), "resolved": experiment.resolved()})
        return
    print(f"{config}: valid")
    times = ", ".join(f"{time:g}" for time in experiment.report_times)
    output.definitions(
        [
            ("question", printable(experiment.question) or "none; make it the first line: # ..."),
            ("system", experiment.system.name),
            ("filters", ", ".join(experiment.labels)),
            ("time", f"to {experiment.time.end:g} in steps of {experiment.time.step:g}; reports at {times}"),
            ("runs", f"{experiment.monte_carlo.runs:,}, seed {experiment.monte_carlo.seed}"),
            ("claims", ", ".join(each.id for each in experiment.claims) or "none"),
            ("results", f"{experiment.experiment}/{experiment.hash12()}"),
        ]
    )
    output.next_step(
        options.command("plan", config, settings), "says how long it takes and how much it needs"
    )


def plan(
    config: options.Config,
    runs: options.Runs = None,
    seed: options.Seed = None,
    settings: options.Set = None,
    out: options.Out = Path("results"),
    precision: options.Precision = None,
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """Say what a run costs, or what is left of it: time, memory, disk."""
    asked = options.precision(precision, runs)
    experiment = options.experiment(config, runs, seed, settings)
    from nlbench import runtime

    runtime.configure(precision=experiment.engine.precision, threads=experiment.engine.threads)
    from nlbench import engine

    cost = engine.plan(experiment, out, None if asked is None else str(asked))
    if json:
        output.as_json(cost)
        return
    planned.show(experiment, cost)
    other = None if out == Path("results") else str(out)
    given = {"--runs": runs, "--precision": precision, "--seed": seed, "--out": other}
    output.next_step(options.command("run", config, settings, *options.words(given)), "runs it")


def doctor(json: options.Json = False) -> None:
    """Check this machine: libraries, devices, settings, disk."""
    from nlbench import doctor as machine
    from nlbench import runtime

    runtime.configure()
    findings = [(str(name), bool(ok), str(detail)) for name, ok, detail in machine.doctor()]
    wrong = [name for name, ok, _ in findings if not ok]
    faults = [EnvironmentFault(f"not in order: {', '.join(wrong)}")] if wrong else []
    if json:
        output.as_json([{"name": name, "ok": ok, "detail": detail} for name, ok, detail in findings], *faults)
    else:
        output.definitions((f"{'ok  ' if ok else 'BAD '} {name}", detail) for name, ok, detail in findings)
        if not wrong:
            output.next_step("nlbench list experiments", "shows what there is to run")
    if faults:
        raise faults[0]
