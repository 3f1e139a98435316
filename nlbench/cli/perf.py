"""`nlbench perf`: whether the filters became slower, as ratios to a kernel that never changes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError, GateError, NothingCompared

if TYPE_CHECKING:
    from nlbench.perf.baseline import Baseline
    from nlbench.perf.gate import Finding

BUDGET = "15%"
STYLES = {"pass": "green", "slower": "red", "counts rose": "red", "undecided": "yellow"}


def perf(
    configs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[CONFIG]...", help="Experiment files to time instead of the standard ones."),
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option("--baseline", metavar="FILE", help="Baseline to compare with [perf-baseline.json]."),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option("--budget", metavar="P%", help="How much slower a workload may become [15%]."),
    ] = None,
    record: Annotated[bool, typer.Option("--record", help="Write the baseline.")] = False,
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """Time the filters against a frozen kernel, and compare with a baseline.

    Exits with 3 if one became slower beyond the budget, or its program grew.
    """
    allowed = _allowed(budget or BUDGET)
    from nlbench.perf import timing

    timing.on_one_thread()  # before jax starts, as the check of a plug-in has it do
    experiments = [options.experiment(each, None, None, None) for each in configs or []]
    precisions = {each.engine.precision for each in experiments} | (set() if experiments else {"float64"})
    if precisions != {"float64"}:
        raise ConfigError("perf: the reference kernel is float64; engine.precision must be too")
    from nlbench.perf.baseline import DEFAULT, of, read, refuse_others, write
    from nlbench.perf.kernel import identity

    path = baseline or DEFAULT
    if budget and baseline is None and not record and not path.exists():
        raise NothingCompared(f"{path}: no baseline to compare with; make one with --record")
    before = None if record or (baseline is None and not path.exists()) else read(path, identity())
    from nlbench import runtime

    runtime.configure()
    from nlbench.perf import gate, kernel, workloads
    from nlbench.results.fingerprint import differences, fingerprint

    chosen = workloads.of_experiments(experiments) if experiments else workloads.standard()
    counts = {each.name: each.counts for each in chosen}
    machine = fingerprint()
    if before and not counts.keys() & before.entries.keys():
        raise NothingCompared(f"{path}: has none of {', '.join(counts)}")
    if before:
        refuse_others(path, before, chosen)
    timer = timing.Timer(kernel.reference(), {each.name: each.call for each in chosen}, timing.clock())
    if before is None:
        estimates = gate.measured(timer.rounds, list(counts), gate.RECORDED_BAND if record else math.inf)
        if record:
            write(path, of(identity(), machine, estimates, chosen))
            if disturbed := gate.disturbed(estimates):
                output.complain(
                    f"{path}: a baseline of a busy machine, bands of {', '.join(disturbed)} are wider than "
                    f"{output.percent(gate.RECORDED_BAND)} %: record it again when nothing else runs here"
                )
        findings = [gate.Finding(name, each, None, None, gate.NEW, {}) for name, each in estimates.items()]
        other: list[str] = []
    else:
        other = differences(machine, before.machine)
        findings = gate.compared(timer.rounds, counts, before, allowed, same_compiler=not other)
    failed = ", ".join(f"{each.name} {each.verdict}" for each in findings if each.verdict in gate.FAILURES)
    faults = [GateError(f"gate failed: {failed}")] if failed else []
    if json:
        code = GateError.exit_code if faults else 0
        output.as_json(_facts(findings, counts, before, allowed, other, code), *faults)
    else:
        _show(findings, before, budget or BUDGET, other)
        _next(path, configs or [], before is not None, record)
    if faults:
        raise faults[0]


def _allowed(budget: str) -> float:
    """What a workload may become slower by, as a fraction. Raises `ConfigError`."""
    (value,) = options.fractions({"--budget": budget})
    if not 0 < value <= 10:
        raise ConfigError(f"--budget: expected above 0% and up to 1000%, found '{budget}'")
    return value


def _show(findings: list[Finding], before: Baseline | None, budget: str, other: list[str]) -> None:
    print("times divided by the reference kernel's, medians; +- holds with 99 %\n")
    if before is None:
        output.rows(
            [("workload", "ratio", "A/A"), *((each.name, _ratio(each), _noise(each)) for each in findings)]
        )
        return
    head = ("workload", "ratio", "baseline", "change", "verdict")
    output.rows([head, *(_row(each) for each in findings)])
    for each in findings:
        if each.risen:
            print(f"\n{each.name}: {', '.join(f'{name} x {by:.2f}' for name, by in each.risen.items())}")
    for each in findings:
        if each.verdict == "undecided":
            print(
                f"\n{each.name}: undecided at a budget of {budget} after {each.now.rounds} rounds; against itself it "
                f"varies by {output.percent(each.now.noise)} %"
            )
    if other:
        print("\nThe baseline is of another machine or compiler: counts are not compared.")
        output.rows([(line[: output.WIDTH - 3],) for line in other])


def _row(each: Finding) -> tuple[str, ...]:
    verdict = output.styled(each.verdict, STYLES[each.verdict]) if each.verdict in STYLES else each.verdict
    if each.entry is None or each.change is None:
        return each.name, f"{each.now.ratio:.3f}", "", "", verdict
    change = f"{100 * math.expm1(each.change.log):+.1f} +- {100 * each.change.band:.1f} %"
    return each.name, f"{each.now.ratio:.3f}", f"{math.exp(each.entry.log_ratio):.3f}", change, verdict


def _ratio(each: Finding) -> str:
    return f"{each.now.ratio:.3f} +- {output.percent(each.now.band)} %"


def _noise(each: Finding) -> str:
    return f"{output.percent(each.now.noise)} %"


def _next(path: Path, configs: list[Path], compared: bool, recorded: bool) -> None:
    if compared:
        return
    import shlex

    given = shlex.join(["nlbench", "perf", *map(str, configs), "--baseline", str(path)])
    if recorded:
        output.next_step(given, "compares with what was just recorded")
    else:
        output.next_step(f"{given} --record", "records these ratios; later calls compare with them")


def _facts(
    findings: list[Finding],
    counts: dict[str, dict[str, float]],
    before: Baseline | None,
    budget: float,
    other: list[str],
    code: int,
) -> dict[str, Any]:
    """What `--json` prints."""
    return {
        "budget": budget,
        "machine_differs": other,
        "counts_compared": before is not None and not other,
        "workloads": [
            {
                "workload": each.name,
                "ratio": each.now.ratio,
                "band": each.now.band,
                "noise": each.now.noise,
                "rounds": each.now.rounds,
                "baseline": math.exp(each.entry.log_ratio) if each.entry else None,
                "change": math.expm1(each.change.log) if each.change else None,
                "change_band": each.change.band if each.change else None,
                "verdict": each.verdict,
                "counts": counts[each.name],
                "counts_risen": each.risen,
            }
            for each in findings
        ],
        "exit_code": code,
    }
