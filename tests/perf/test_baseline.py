"""Claim: a baseline is read as it was written, and any other file is refused in one line."""

from __future__ import annotations

import json
import math

import pytest
from typer.testing import CliRunner

from nlbench.cli.app import app
from nlbench.errors import ConfigError
from nlbench.perf import baseline, kernel, workloads
from nlbench.perf.workloads import Workload
from tests import small_runs

GOOD = {
    "schema": 2,
    "kernel": "k",
    "machine": {"jaxlib": "1"},
    "workloads": {"a": {"ratio": 2.0, "band": 0.01, "counts": {"flops": 3}, "experiment": "e"}},
}


def test_is_read_as_it_was_written(tmp_path):
    made = baseline.Baseline(
        "k", {"jaxlib": "1"}, {"a": baseline.Entry(math.log(2), 0.01, {"flops": 3.0}, "e")}
    )
    baseline.write(tmp_path / "b.json", made)
    found = baseline.read(tmp_path / "b.json", "k")
    assert found.entries["a"].log_ratio == pytest.approx(math.log(2), rel=1e-15)
    assert found._replace(entries={}) == made._replace(entries={})
    assert json.loads((tmp_path / "b.json").read_text()) == GOOD


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": 1}, "schema 1; this version reads schema 2: record it again"),
        ({"kernel": "other"}, "measured with reference kernel other, this is k"),
        ({"workloads": []}, "no baseline of"),
        ({"workloads": {"a": {"ratio": -1, "band": 0, "counts": {}}}}, "no baseline of"),
        ({"workloads": {"a": {"ratio": 1, "band": math.nan, "counts": {}}}}, "no baseline of"),
        ({"machine": None}, "no baseline of"),
    ],
)
def test_another_file_is_refused(tmp_path, change, message):
    (tmp_path / "b.json").write_text(json.dumps(GOOD | change))
    with pytest.raises(ConfigError, match=message):
        baseline.read(tmp_path / "b.json", "k")


def test_a_baseline_of_another_experiment_of_the_same_name_is_refused(tmp_path):
    (tmp_path / "b.json").write_text(json.dumps(GOOD))
    found = baseline.read(tmp_path / "b.json", "k")
    same, other = (Workload("a", lambda: None, {}, name) for name in ("e", "f"))
    baseline.refuse_others(tmp_path / "b.json", found, [same])
    with pytest.raises(ConfigError, match=r"b\.json: was measured on other experiments .*\(a\)"):
        baseline.refuse_others(tmp_path / "b.json", found, [other])


def test_a_gate_without_a_baseline_does_not_pass(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["perf", "--budget", "25%"])
    assert done.exit_code == 7
    assert "perf-baseline.json: no baseline to compare with" in done.stderr


def test_files_of_one_name_are_refused():
    named = small_runs.experiment()
    with pytest.raises(ConfigError, match="several files have the experiment small"):
        workloads.of_experiments([named, named])


@pytest.mark.parametrize("text", ["", "[]", "{}", "\x00", "[" * 100_000])
def test_what_is_no_baseline_is_refused(tmp_path, text):
    (tmp_path / "b.json").write_text(text)
    with pytest.raises(ConfigError, match="no baseline"):
        baseline.read(tmp_path / "b.json", "k")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--baseline", "none.json"], "none.json: cannot read the baseline: no such file or directory"),
        (["--baseline", "none.json", "--budget", "9%"], "none.json: cannot read the baseline: no such file"),
        (["--budget", "x"], "--budget: expected a number or a percentage such as 1%, found 'x'"),
        (["--budget", "0%"], "--budget: expected above 0% and up to 1000%, found '0%'"),
        (["--budget", "nan"], "--budget: expected above 0% and up to 1000%, found 'nan'"),
        (["none.yaml"], "none.yaml: cannot read the experiment"),
    ],
)
def test_a_mistake_ends_with_two_before_anything_is_timed(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["perf", *arguments])
    assert done.exit_code == 2
    assert message in done.stderr
    assert not list(tmp_path.iterdir())


def test_the_kernel_is_the_one_that_baselines_were_measured_with():
    """A changed kernel makes every baseline worthless: give it another version, and only with good reason."""
    assert kernel.identity() == "1:a5ea3cd22ae29137"
