"""Claim: every way a command ends has its documented exit code, and stderr says why without a traceback."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest
from typer.testing import CliRunner

from nlbench import engine, errors
from nlbench.cli.app import app
from nlbench.cli.signals import heeded
from tests.example import VALID, spoiled, written


def command(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    here = str(Path(__file__).parents[2])
    environment = os.environ | {"PYTHONPATH": here, "COLUMNS": "80"}
    line = [sys.executable, "-m", "nlbench", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, cwd=cwd, env=environment, check=False)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "Missing argument"),
        (["run", "none.yaml"], "none.yaml: cannot read the experiment: no such file"),
        (["run", "bad.yaml"], "bad.yaml:6:25: filters.1.limter: unknown key; did you mean 'limiter'?"),
        (["run", "good.yaml", "--runs", "-1"], "--runs: monte_carlo.runs: expected a whole number from 1 to"),
        (["run", "good.yaml", "--seed", "x"], "--seed: monte_carlo.seed: expected a whole number from 0 to"),
        (["run", "good.yaml", "--set", "time.stp=1"], "--set time.stp: unknown key; did you mean 'step'?"),
        (["run", "noclaims.yaml", "--gate"], "--gate needs claims, and the file makes none"),
        (["validate", "."], "cannot read the experiment: is a directory"),
        (["rum"], "No such command 'rum'. Did you mean 'run'?"),
        (["list", "filtres"], "filtres"),
        (["list", "filters", "efk"], "unknown filter 'efk'; did you mean 'ekf'?"),
        (["list", "experiments"], "no folder 'configs' here"),
        (["replay", "good.yaml", "--filter", "third", "--trajectory", "1"], "no filter is labelled 'third'"),
        (["report", "good.yaml"], "no results in results/culver/hermite-01/"),
    ],
)
def test_a_mistake_ends_with_two_and_writes_nothing(tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, VALID, "good.yaml")
    written(tmp_path, spoiled("limiter", "limter"), "bad.yaml")
    written(tmp_path, VALID[: VALID.index("claims:")], "noclaims.yaml")
    done = CliRunner().invoke(app, arguments, env={"COLUMNS": "80"})
    assert done.exit_code == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert len(list(tmp_path.iterdir())) == 3


def test_a_valid_file_ends_with_zero_and_a_next_step(tmp_path):
    done = command("validate", written(tmp_path, VALID).name, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "next: nlbench plan fig.yaml" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80


ERRORS = [
    (errors.NlbenchError("x"), 1),
    (errors.ConfigError("x"), 2),
    (errors.GateError("x"), 3),
    (errors.LimitError("x"), 4),
    (errors.EnvironmentFault("x"), 5),
    (errors.DamagedResults("x"), 5),
    (errors.LockedError("x"), 6),
    (errors.NothingCompared("x"), 7),
    (errors.Interrupted("x"), 130),
    (KeyboardInterrupt(), 130),
    (MemoryError(), 5),
    (OSError(errno.ENOSPC, "No space left on device"), 5),
    (ZeroDivisionError("by design"), 1),
]


@pytest.mark.parametrize(("error", "code"), ERRORS, ids=lambda each: getattr(type(each), "__name__", each))
def test_each_error_ends_with_its_code(tmp_path, monkeypatch, error, code):
    def fail(*arguments, **options):
        raise error

    monkeypatch.setattr(engine, "run", fail)
    monkeypatch.delenv("NLBENCH_DEBUG", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    done = CliRunner().invoke(app, ["run", str(written(tmp_path, VALID))])
    assert done.exit_code == code
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == (2 if isinstance(error, ZeroDivisionError) else 1)


def test_an_internal_error_is_one_line_and_its_traceback_is_put_aside(tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "run", lambda *arguments, **options: 1 / 0)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delenv("NLBENCH_DEBUG", raising=False)
    done = CliRunner().invoke(app, ["run", str(written(tmp_path, VALID))])
    assert done.stderr.startswith("internal error: ZeroDivisionError: division by zero\n")
    (kept,) = tmp_path.glob("nlbench-*.txt")
    assert str(kept) in done.stderr
    assert "Traceback" in kept.read_text()


@pytest.mark.parametrize("name", ["plan", "replay"])
def test_memory_that_runs_out_is_no_internal_error(tmp_path, monkeypatch, name):
    def fail(*arguments):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(f"nlbench.engine.{'trace' if name == 'replay' else 'planning.plan'}.make", fail)
    more = ["--filter", "third-order-guarded", "--trajectory", "0"] if name == "replay" else []
    done = CliRunner().invoke(app, [name, str(written(tmp_path, VALID)), *more])
    assert done.exit_code == 5
    assert done.stderr.startswith("out of memory: can't start new thread. ")


def test_stdout_that_is_full_or_closed_does_not_hide_how_a_command_ends(tmp_path):
    good = written(tmp_path, VALID, "good.yaml")
    with Path("/dev/full").open("w") as full:
        done = piped("validate", good, stdout=full)
    assert (done.returncode, done.stderr) == (5, "cannot write: No space left on device\n")
    bad = written(tmp_path, spoiled("limiter", "limter"), "bad.yaml")
    with Path("/dev/full").open("w") as full:
        done = piped("validate", bad, stdout=full)
    assert done.returncode == 2
    assert "did you mean 'limiter'?" in done.stderr
    with Path("/dev/full").open("w") as full:
        done = piped("validate", bad, "--json", stdout=full)
    assert (done.returncode, done.stderr) == (5, "cannot write: No space left on device\n")


def piped(*arguments: str | Path, stdout: IO[str]) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "nlbench", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.run(
        line, stdout=stdout, stderr=subprocess.PIPE, text=True, env=environment, check=False
    )


def test_names_that_are_no_text_are_printed(tmp_path):
    name = os.fsdecode(b"r\xff.yaml")
    done = command("validate", written(tmp_path, VALID, name).name, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert r"r\udcff.yaml: valid" in done.stdout


@pytest.mark.parametrize("interrupts", [signal.default_int_handler, signal.SIG_IGN])
def test_sigterm_stops_a_run_like_ctrl_c(tmp_path, monkeypatch, interrupts):
    """Also where SIGINT is ignored, as shells have it for background jobs of a script."""

    def killed(*arguments, **options):
        signal.raise_signal(signal.SIGTERM)  # a signal to the process may reach another thread, later
        raise AssertionError("SIGTERM did not arrive")

    monkeypatch.setattr(engine, "run", killed)
    terminates, earlier = signal.getsignal(signal.SIGTERM), signal.signal(signal.SIGINT, interrupts)
    try:
        with heeded():  # as `main` does
            done = CliRunner().invoke(app, ["run", str(written(tmp_path, VALID))])
    finally:
        signal.signal(signal.SIGINT, earlier)
    assert done.exit_code == 130
    assert signal.getsignal(signal.SIGTERM) is terminates


def test_python_m_nlbench_is_the_same_program(tmp_path):
    done = command("--help", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.startswith("Usage: nlbench [OPTIONS] COMMAND")
    assert max(map(len, done.stdout.splitlines())) <= 80
