"""Claims: a second Ctrl-C or SIGTERM ends a run at once, even in the middle of what Python cannot interrupt; one that
comes while jax is imported ends the command as any other does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import nlbench as nb
from nlbench.engine import finish
from nlbench.engine.interruption import stop_requests
from nlbench.errors import Interrupted
from tests.faults.quick import small
from tests.small_runs import python

# One long call that releases the lock of the interpreter, as a compilation is.
BUSY = """
import hashlib
from nlbench.cli.signals import ended_by_a_second, heeded
from nlbench.engine.interruption import stop_requests
with heeded(), ended_by_a_second(), stop_requests():
    print("busy", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"a", b"b", 100_000_000)
"""


@pytest.mark.parametrize("numbers", [(signal.SIGINT, signal.SIGINT), (signal.SIGTERM, signal.SIGINT)])
def test_a_second_signal_ends_a_call_that_python_cannot_interrupt(numbers):
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    program = [sys.executable, "-c", BUSY]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(program, text=True, env=environment, **pipes) as process:
        assert process.stdout.readline() == "busy\n"  # the first signal may come before or during the call
        for number in numbers:
            assert process.poll() is None
            process.send_signal(number)
            time.sleep(0.3)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said.endswith("interrupted; the same command goes on from what was saved\n"), said


def test_a_signal_that_is_ignored_stays_so():
    """As SIGINT is in the background jobs of a script, which then are stopped by SIGTERM."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with stop_requests() as stopped:
            signal.raise_signal(signal.SIGINT)
            assert not stopped()
            signal.raise_signal(signal.SIGTERM)
            assert stopped()
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("stage", ["trace_tables", "cost_table"])
def test_a_signal_after_the_last_block_stops_before_what_takes_long(tmp_path, monkeypatch, quick, stage):
    def signalled(*given):
        signal.raise_signal(signal.SIGTERM)
        return {} if stage == "trace_tables" else None

    monkeypatch.setattr(finish, stage, signalled)
    asked = small(traces=[3], engine={"chunk": 1, "threads": 2, "cost": True})
    with pytest.raises(Interrupted, match="all runs are saved"):
        nb.run(asked, tmp_path)
    assert not list(tmp_path.rglob("DONE"))
    monkeypatch.undo()


def test_one_signal_does_not():
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    program = BUSY.replace("100_000_000", "1_000_000") + "print('done')"
    with subprocess.Popen(
        [sys.executable, "-c", program],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        assert process.stdout.readline() == "busy\n"
        process.send_signal(signal.SIGINT)
        printed, said = process.communicate(timeout=60)
    assert (process.returncode, printed) == (0, "done\n")
    assert "stopping once the blocks in flight are saved" in said


# An extension module crashes, or makes an ImportError of what is raised while it is imported.
IMPORTING = """
import os, signal, sys, time

class Extension:
    def find_spec(self, name, path=None, target=None):
        if name == "jax":
            try:
                os.kill(os.getpid(), signal.SIGNAL)
                time.sleep(5)
            except KeyboardInterrupt:
                raise ImportError("Encountered an error while initializing the extension.")

sys.meta_path.insert(0, Extension())
from nlbench.cli import main
main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_during_an_import_ends_the_command_as_any_other(name, tmp_path):
    file = Path(__file__).parents[2] / "configs" / "quickstart.yaml"
    done = python(IMPORTING.replace("SIGNAL", name), "run", str(file), "--out", str(tmp_path))
    assert (done.returncode, done.stdout) == (130, ""), done.stderr
    assert done.stderr == "interrupted; the same command goes on from what was saved\n"
    assert not list(tmp_path.iterdir())
