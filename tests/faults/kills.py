"""Kills a run at random moments, goes on with it each time, and compares its tables with those of an undisturbed run.

    python -m tests.faults.kills [--kills 20] [--runs 400000] [--seed 0] [--config FILE]

A moment is drawn evenly from the time that a whole run takes; a run that ends before it, or in spite of the signal
since it was finishing, counts for nothing, and another begins in an empty folder. kill -9, SIGTERM and Ctrl-C take
turns at random; after the last, the run may end.
"""

# ruff: noqa: T201 - a script, which prints what it found

from __future__ import annotations

import argparse
import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
NOT_COMPARED = "cost"  # which is measured


class Killed(NamedTuple):
    """The signals that were sent, and how each run that got one ended; SHA-256 of the tables by name, of the
    undisturbed run and of each whole run that came out."""

    signals: list[tuple[str, int]]
    undisturbed: dict[str, str]
    resumed: list[dict[str, str]]


def start(config: Path, runs: int, out: Path) -> subprocess.Popen:
    """The command, as a user gives it."""
    command = ["run", str(config), "--runs", str(runs), "--out", str(out), "--set", "engine.chunk=4"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "nlbench", *command],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def checksums(out: Path) -> dict[str, str]:
    """Of the tables of the one finished run below a folder."""
    (done,) = out.rglob("DONE")
    tables = (path for path in (done.parent / "tables").iterdir() if path.stem != NOT_COMPARED)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(tables)}


def ended(process: subprocess.Popen) -> None:
    """Wait for a run that nothing disturbs."""
    if process.wait():
        raise RuntimeError(f"a run that nobody disturbed ended with exit code {process.returncode}")


def killed(folder: Path, config: Path, runs: int, kills: int, seed: int) -> Killed:
    """Do it, in an empty folder."""
    # Children of a background job would ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    drawn = random.Random(seed)
    ended(start(config, 64, folder / "compiled"))  # so that no later run compiles
    begun = time.monotonic()
    ended(start(config, runs, folder / "undisturbed"))
    span = time.monotonic() - begun
    signals, resumed = [], []
    out = folder / "killed"
    while len(signals) < kills:
        process = start(config, runs, out)
        try:
            process.wait(drawn.uniform(0, span))
        except subprocess.TimeoutExpired:
            number = drawn.choice(SIGNALS)
            process.send_signal(number)
            if process.wait() in (130, -number):  # the latter as well where Python has only begun to start
                signals.append((number.name, process.returncode))
                continue
        ended(process)
        resumed.append(checksums(out))
        shutil.rmtree(out)
    ended(start(config, runs, out))
    return Killed(signals, checksums(folder / "undisturbed"), [*resumed, checksums(out)])


def main() -> int:
    """Say what was done; 1 if any table differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--runs", type=int, default=400_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--config", type=Path, default=ROOT / "configs" / "quickstart.yaml")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = killed(Path(folder), given.config.resolve(), given.runs, given.kills, given.seed)
    for name, code in found.signals:
        print(f"{name:8} ended with {code}")
    for name, checksum in found.undisturbed.items():
        same = all(each.get(name) == checksum for each in found.resumed)
        print(f"{checksum}  {name}{'' if same else '  DIFFERS'}")
    print(f"{len(found.signals)} kills, {len(found.resumed)} whole runs among them")
    return int(any(each != found.undisturbed for each in found.resumed))


if __name__ == "__main__":
    sys.exit(main())
