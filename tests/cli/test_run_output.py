"""Claim: `run` tells the essence: errors with their uncertainty, divergence, verdicts, and FAILED as such."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pandas as pd
import pytest
from typer.testing import CliRunner

from nlbench import engine, report
from nlbench.cli.app import app
from tests.example import VALID, written

LABELS = ("linearised-kalman", "third 3 sigma", "third-order-guarded", "exact")


def statistics(values: dict[str, float]) -> pd.DataFrame:
    rows = [
        {
            "filter": label,
            "time": time,
            "coordinate": "x",
            "statistic": name,
            "value": value,
            "stderr": 0.0012,
            "n": 100,
        }
        for label, value in values.items()
        for time in (0.0, 0.5, 0.9, 1.0, 1.5, 2.0, "all")
        for name in ("rms", "mean_error")
    ]
    return pd.DataFrame(rows)


def divergence(counts: dict[str, int]) -> pd.DataFrame:
    rows = [
        {
            "filter": label,
            "n": 100_000,
            "diverged": count,
            "fraction": count / 1e5,
            "low": 0.00026,
            "high": 0.00051,
        }
        for label, count in counts.items()
    ]
    return pd.DataFrame(rows)


def claims(verdict: str) -> pd.DataFrame:
    row = {
        "id": "C1",
        "says": "s",
        "verdict": verdict,
        "estimate": -0.01,
        "low": -0.02,
        "high": -0.005,
        "n": 100,
    }
    return pd.DataFrame([row])


@pytest.fixture
def invoke(tmp_path, monkeypatch):
    """Run the command on a run that is made up: rms values, numbers of diverged runs, the verdict of the claim."""

    def invoke(*options, values=None, diverged=None, verdict="confirmed", text=VALID):
        tables = {
            "statistics": statistics(dict.fromkeys(LABELS, 0.1234) | (values or {})),
            "divergence": divergence(dict.fromkeys(LABELS, 0) | (diverged or {})),
            "claims": claims(verdict),
        }
        results = SimpleNamespace(path=tmp_path / "r", table=tables.__getitem__, manifest={"runs": 25_000})
        monkeypatch.setattr(engine, "run", lambda *arguments, **keywords: results)
        monkeypatch.setattr(report, "write", lambda results: results.path / "report.html", raising=False)
        return CliRunner().invoke(app, ["run", str(written(tmp_path, text)), *options])

    return invoke


def test_the_table_has_each_filter_at_the_report_times_with_standard_errors(invoke, tmp_path):
    done = invoke()
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert (
        "culver/hermite-01, 25,000 runs, seed 1969" in done.stdout
    )  # more than the file asks for were there
    assert "t = 0.5" in done.stdout
    assert "t = 0.9" not in done.stdout
    rows = [line for line in lines if line.startswith("  third 3 sigma") and "(12)" in line]
    assert len(rows) == 1
    assert rows[0].split()[3:] == ["0.1234(12)"] * 4
    assert max(len(line) for line in lines if str(tmp_path) not in line) <= 80


def test_diverged_runs_are_counted_with_their_interval(invoke):
    done = invoke(diverged={"third 3 sigma": 37})
    assert "diverged 37 of 100,000 (0.037 % [0.026, 0.051])" in done.stdout
    assert done.exit_code == 0


def test_a_filter_without_a_number_is_failed_and_ends_with_four(invoke):
    done = invoke(values={"third 3 sigma": float("nan")})
    assert done.exit_code == 4
    assert "FAILED" in next(line for line in done.stdout.splitlines() if line.startswith("  third 3 sigma"))
    assert "FAILED: third 3 sigma: no run gave a usable estimate" in done.stderr
    assert "0.1234(12)" in done.stdout


def test_a_filter_that_always_diverges_is_failed(invoke):
    assert invoke(diverged={"third 3 sigma": 100_000}).exit_code == 4


def test_divergence_beyond_the_limit_of_the_file_ends_with_four(invoke):
    limited = VALID + "limits: {diverged: 0.0003}\n"
    done = invoke(diverged={"third 3 sigma": 37}, text=limited)
    assert done.exit_code == 4
    assert "third 3 sigma: diverged in 0.037 % of the runs; limits.diverged allows 0.030 %" in done.stderr
    assert invoke(diverged={"third 3 sigma": 30}, text=limited).exit_code == 0


@pytest.mark.parametrize(("verdict", "code"), [("confirmed", 0), ("refuted", 3), ("undecided", 3)])
def test_claims_decide_the_exit_code_only_at_the_gate(invoke, verdict, code):
    assert invoke("--gate", verdict=verdict).exit_code == code
    done = invoke(verdict=verdict)
    assert done.exit_code == 0
    assert f"C1  {verdict}" in done.stdout


def test_json_is_one_document_in_which_nan_is_null(invoke):
    done = invoke("--json", values={"exact": float("nan")}, verdict="refuted")
    facts = json.loads(done.stdout)
    assert facts["exit_code"] == done.exit_code == 4
    assert [row["value"] for row in facts["rms"] if row["filter"] == "exact"] == [None] * 4
    assert facts["claims"][0]["verdict"] == "refuted"
    assert facts["runs"] == 25_000


def test_options_reach_the_experiment(invoke, monkeypatch, tmp_path):
    seen = {}

    def run(experiment, out, progress, check, dask):
        seen.update(experiment=experiment, out=out)
        raise KeyboardInterrupt

    invoke()
    monkeypatch.setattr(engine, "run", run)
    CliRunner().invoke(
        app,
        [
            "run",
            str(tmp_path / "fig.yaml"),
            "--runs",
            "1e5",
            "--seed",
            "7",
            "--set",
            "time.step=0.01",
            "--out",
            "elsewhere",
        ],
    )
    assert seen["experiment"].monte_carlo.runs == 100_000
    assert seen["experiment"].monte_carlo.seed == 7
    assert seen["experiment"].time.step == 0.01
    assert str(seen["out"]) == "elsewhere"


def test_output_that_is_not_a_terminal_has_no_control_characters(invoke):
    done = invoke(verdict="refuted", diverged={"third 3 sigma": 100_000})
    assert all(letter.isprintable() or letter == "\n" for letter in done.stdout + done.stderr)
