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


def test_verify_says_what_it_found_once(tmp_path):
    (tmp_path / "batches").mkdir()  # a run was begun here
    done = CliRunner().invoke(app, ["verify", str(tmp_path), "--json"])
    assert done.exit_code == 5
    assert json.loads(done.stdout) == {"exit_code": 5, "error": done.stderr.rstrip("\n")}
    assert "not finished" in done.stderr
