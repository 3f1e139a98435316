"""Claim: a second Ctrl-C or SIGTERM ends a run at once, even in the middle of what Python cannot interrupt."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

# One long call that releases the lock of the interpreter, as a compilation is.
BUSY = """
import hashlib
from nlbench.cli.signals import ended_by_a_second, terminated_like_interrupted
from nlbench.engine.interruption import stop_requests
with stop_requests(), terminated_like_interrupted(), ended_by_a_second():
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
