"""Claim: who asks for JSON gets one JSON document on stdout, also where the command fails, with its exit code."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from nlbench import engine, errors
from nlbench.cli.app import app
from tests.example import VALID, spoiled, written


@pytest.mark.parametrize(
    "error", [errors.EnvironmentFault("full"), errors.LockedError("in use"), errors.Interrupted("x")]
)
def test_an_error_of_a_run_is_on_stdout_and_on_stderr(tmp_path, monkeypatch, error):
    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr(engine, "run", fail)
    done = CliRunner().invoke(app, ["run", str(written(tmp_path, VALID)), "--json"])
    assert done.exit_code == error.exit_code
    assert json.loads(done.stdout) == {"exit_code": error.exit_code, "error": str(error)}
    assert done.stderr == f"{error}\n"


def test_a_mistake_in_the_file_too(tmp_path):
    done = CliRunner().invoke(app, ["run", str(written(tmp_path, spoiled("limiter", "limter"))), "--json"])
    assert done.exit_code == 2
    assert "did you mean 'limiter'?" in json.loads(done.stdout)["error"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (["validate", "none.yaml", "--json"], 2, None),
        (["plan", "none.yaml", "--json"], 2, "cannot read the experiment"),
        (["compare", "a", "b", "--json"], 2, "a: no such folder of a run"),
        (["perf", "--budget", "x", "--json"], 2, "--budget: expected a number or a percentage"),
        (["list", "filters", "efk", "--json"], 2, "did you mean 'ekf'?"),
        (["filter", "none.yaml", "data.csv", "--json"], 2, "cannot read the experiment"),
        (["replay", "none.yaml", "--filter", "ekf", "--trajectory", "0", "--json"], 2, "cannot read"),
        (["run", "fig.yaml", "--plugin", "none.py", "--json"], 2, "none.py"),
        (["run", "fig.yaml", "--rums", "1", "--json"], 2, "No such option"),
        (["run", "--json"], 2, "Missing argument"),
    ],
)
def test_whatever_the_command(tmp_path, monkeypatch, words, code, said):
    written(tmp_path, VALID)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, words)
    assert done.exit_code == code
    found = json.loads(done.stdout)  # one document
    if said is None:  # a document of its own
        assert found["valid"] is False
        return
    assert found["exit_code"] == code
    assert said in found["error"]
    assert found["error"].splitlines()[0] in " ".join(done.stderr.split())


def test_ctrl_c_and_what_is_no_mistake_of_the_user_too(tmp_path, monkeypatch):
    def fail(*arguments, **options):
        raise KeyboardInterrupt if not said else ZeroDivisionError("by design")

    said = []
    monkeypatch.setattr(engine, "run", fail)
    monkeypatch.delenv("NLBENCH_DEBUG", raising=False)
    for code, words in ((130, "interrupted"), (1, "internal error: ZeroDivisionError: by design")):
        done = CliRunner().invoke(app, ["run", str(written(tmp_path, VALID)), "--json"])
        found = json.loads(done.stdout)
        assert (done.exit_code, found["exit_code"]) == (code, code)
        assert words in found["error"]
        said.append(code)


def test_verify_says_what_it_found_once(tmp_path):
    (tmp_path / "batches").mkdir()  # a run was begun here
    done = CliRunner().invoke(app, ["verify", str(tmp_path), "--json"])
    assert done.exit_code == 5
    assert json.loads(done.stdout) == {"exit_code": 5, "error": done.stderr.rstrip("\n")}
    assert "not finished" in done.stderr
