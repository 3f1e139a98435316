"""The essence of a run: rms at the report times, divergence, claims; and what makes the command fail."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from nlbench.cli import output
from nlbench.errors import GateError, LimitError, NlbenchError, printable
from nlbench.results.reasons import failed as labels_failed
from nlbench.results.reasons import left_out, rms_rows, told

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.config.precision import Precision

VERDICT_STYLES = {"confirmed": "green", "refuted": "red"}


def facts(experiment: Experiment, results: Any, report: Path) -> dict[str, Any]:
    """What `--json` prints, and what the other functions here read."""
    folder = Path(results.path)
    return {
        "experiment": experiment.experiment,
        "hash": experiment.hash12(),
        "runs": results.manifest["runs"],  # at least those asked for
        "seed": experiment.monte_carlo.seed,
        "folder": str(folder),
        "report": str(report),
        "figures": sorted(str(each) for each in (folder / "figures").glob("*")),
        "rms": rms_rows(results.table("statistics"), experiment.report_times),
        "divergence": _records(results.table("divergence")),
        **{
            name: _records(results.table(name))
            for name in ("failures", "left_out")
            if (folder / "tables" / f"{name}.csv").exists()
        },
        "claims": _records(results.table("claims")) if experiment.claims else [],
    }


def precision(asked: Precision, chosen: Any, experiment: Experiment, results: Any) -> dict[str, Any]:
    """What precision was asked for, the runs chosen, and the largest standard error that they gave, as a share."""
    from nlbench.engine.planning.precision import reached

    share = reached(asked, results.table("statistics"), experiment.report_times)
    return {"asked": str(asked), **chosen._asdict(), "reached": share}


def failed(facts: dict[str, Any]) -> dict[str, str]:
    """Find the filters without a single usable number, each with when and in what it first went wrong, if known."""
    reasons = {row["filter"]: told(row) for row in facts.get("failures", [])}
    return {label: reasons.get(label, "") for label in labels_failed(facts["divergence"], facts["rms"])}


def faults(experiment: Experiment, facts: dict[str, Any], gate: bool) -> list[NlbenchError]:
    """What makes the command fail, the gravest first."""
    found: list[NlbenchError] = []
    lost, limit = failed(facts), experiment.limits.diverged
    found += [
        LimitError(f"FAILED: {label}: no run gave a usable estimate{reason and f'; {reason}'}")
        for label, reason in lost.items()
    ]
    for row in facts["divergence"]:
        if row["filter"] not in lost and row["diverged"] / row["n"] > limit:
            share = f"{output.percent(row['diverged'] / row['n'])} % of the runs"
            allowed = f"limits.diverged allows {output.percent(limit)} %"
            found.append(LimitError(f"FAILED: {row['filter']}: diverged in {share}; {allowed}"))
    if gate:
        open_claims = [
            f"{each['id']} {each['verdict']}" for each in facts["claims"] if each["verdict"] != "confirmed"
        ]
        found += [GateError(f"gate failed: {', '.join(open_claims)}")] if open_claims else []
    return found


def show(experiment: Experiment, facts: dict[str, Any]) -> None:
    """Print the facts within 80 columns."""
    print(
        output.styled(printable(experiment.question), "bold")
        if experiment.question
        else experiment.experiment
    )
    print(f"{experiment.experiment}, {facts['runs']:,} runs, seed {facts['seed']}, results {facts['hash']}\n")
    lost = failed(facts)
    for coordinate in dict.fromkeys(row["coordinate"] for row in facts["rms"]):
        _rms(experiment, [row for row in facts["rms"] if row["coordinate"] == coordinate], coordinate, lost)
    print("\nruns that diverged")
    output.rows(
        [row["filter"], _diverged(row), _failed(row["filter"] in lost)] for row in facts["divergence"]
    )
    notes = [f"{label}: {reason}" for label, reason in lost.items() if reason]
    notes += [
        f"{row['filter']}: left out of NIS: {left_out(row)}"
        for row in facts.get("left_out", [])
        if row["time"] == "all" and row["invalid"]
    ]
    for note in notes:
        print(fill(note, output.WIDTH, initial_indent="  ", subsequent_indent="    "))
    if facts["claims"]:
        print("\nclaims")
        says = {each.id: each.says for each in experiment.claims}
        for row in facts["claims"]:
            verdict = output.styled(row["verdict"].ljust(9), VERDICT_STYLES.get(row["verdict"], "yellow"))
            print(f"  {row['id']}  {verdict}  {says.get(row['id'], row['says'])}")
    if "precision" in facts:
        print(f"\nprecision  {_reached(facts['precision'])}")
    print("\nfiles")
    written = [("report", facts["report"]), ("tables", f"{facts['folder']}/tables")]
    output.rows([*written, ("figures", f"{facts['folder']}/figures ({len(facts['figures'])})")])


def _reached(found: dict[str, Any]) -> str:
    """Asked and reached; the runs were chosen from a pilot, so that it can be missed by a little."""
    left_out = f"; without a usable value: {', '.join(found['left_out'])}" if found["left_out"] else ""
    return f"asked {found['asked']}, reached {output.percent(found['reached'])} % at worst{left_out}"


def _rms(experiment: Experiment, rows: list[dict[str, Any]], coordinate: str, lost: Container[str]) -> None:
    label_width = max(len(label) for label in experiment.labels)
    columns = max(1, (output.WIDTH - label_width - 2) // 13)
    times = sorted({float(row["time"]) for row in rows})
    cells = {(row["filter"], float(row["time"])): row for row in rows}
    print(f"rms error of {coordinate}; 0.1234(12) is 0.1234 with a standard error of 0.0012")
    for start in range(0, len(times), columns):
        shown = times[start : start + columns]
        table = [["", *(f"t = {time:g}" for time in shown)]]
        for label in experiment.labels:
            values = [cells.get((label, time)) for time in shown]
            text = [output.uncertain(row["value"], row["stderr"]) if row else "" for row in values]
            table.append([label, *(["FAILED"] * len(shown) if label in lost else text)])
        output.rows(table)


def _diverged(row: dict[str, Any]) -> str:
    interval = f"[{output.percent(row['low'])}, {output.percent(row['high'])}]"
    return (
        f"diverged {row['diverged']:,.0f} of {row['n']:,.0f} ({output.percent(row['fraction'])} % {interval})"
    )


def _failed(is_so: bool) -> str:
    return output.styled("FAILED", "red") if is_so else ""


def _records(frame: Any) -> list[dict[str, Any]]:
    return frame.to_dict(orient="records")
