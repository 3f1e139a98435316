"""What `plan` says against what `run` takes: time, memory and disk, one experiment after another.

    python -m benchmarks.planning [--rounds 3] [--seconds 60] ["FILE key=value ..." ...]

Each round plans and then runs each experiment in processes of their own, into an empty folder and with an empty cache
of compiled programs, as someone does who does it for the first time; with as many runs as take about `--seconds` by a
first plan. On a machine with other work the two see different machines: rounds alternate, and the medians of their
ratios count.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
# Scalar and cheap; three states with an exact reference; an orbit; sigma points in discrete time; a continuous
# measurement; a reference of particles.
FILES = (
    "configs/quickstart.yaml",
    "configs/culver/oscillator.yaml",
    "configs/culver/orbit-polar.yaml",
    "configs/problems/re-entry.yaml",
    "configs/schwartz/d1-m11.yaml",
    "configs/problems/ungm.yaml reference=particles claims=[]",
)


class Cost(NamedTuple):
    """Seconds, the largest resident memory and the bytes on disk."""

    seconds: float
    memory: float
    disk: float


def main() -> None:
    """Print a row for each experiment and round, then the medians."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", nargs="*", default=FILES, metavar="FILE")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=60.0)
    given = parser.parse_args()
    runs = {file: _runs(file, given.seconds) for file in given.files}
    ratios: dict[str, list[Cost]] = {file: [] for file in given.files}
    print("planned / actual: time, memory, disk")
    for _ in range(given.rounds):
        for file in given.files:
            with tempfile.TemporaryDirectory() as cache:
                os.environ["NLBENCH_CACHE"] = cache
                planned, actual = _planned(file, runs[file]), _actual(file, runs[file])
            ratios[file].append(Cost(*(a / b for a, b in zip(planned, actual, strict=True))))
            print(f"{file}, {runs[file]:,} runs: {_words(planned, actual)}", flush=True)
    print("medians")
    for file, found in ratios.items():
        middle = (statistics.median(part) for part in zip(*found, strict=True))
        print(f"{file}: " + ", ".join(f"{each:.2f}" for each in middle))


def _words(planned: Cost, actual: Cost) -> str:
    units = (("s", 1.0), ("MB", 1e6), ("MB", 1e6))
    return "; ".join(
        f"{a / scale:.1f} / {b / scale:.1f} {unit} = {a / b:.2f}"
        for a, b, (unit, scale) in zip(planned, actual, units, strict=True)
    )


def _runs(file: str, seconds: float) -> int:
    """Runs that take about so long, by a plan."""
    plan = _plan(file, 10_000)
    rest = plan["seconds"]["total"] - plan["seconds"]["run"]
    return max(1_000, int(10_000 * max(seconds - rest, 0.2 * seconds) / plan["seconds"]["run"]))


def _plan(file: str, runs: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [*_command("plan", file, runs, folder), "--json"],
            cwd=ROOT,
            check=True,
            capture_output=True,
            text=True,
        )
    return json.loads(done.stdout)


def _planned(file: str, runs: int) -> Cost:
    plan = _plan(file, runs)
    disk = plan["disk_bytes"]
    left = disk["total"] - disk["checkpoint_replaced"]  # which is gone at the end
    return Cost(plan["seconds"]["total"], plan["memory_bytes"]["total"], left)


def _actual(file: str, runs: int) -> Cost:
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        process = subprocess.Popen(
            [*_command("run", file, runs, folder), "--json"], cwd=ROOT, stdout=subprocess.DEVNULL
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.perf_counter() - begun
        if process.returncode not in (0, 4):
            raise SystemExit(f"{file}: exit {process.returncode}")
        disk = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    return Cost(seconds, _resident(used), disk)


def _resident(used: resource.struct_rusage) -> float:
    return used.ru_maxrss * 1024.0


def _command(name: str, file: str, runs: int, folder: str) -> list[str]:
    path, *settings = file.split()
    words = [word for setting in settings for word in ("--set", setting)]
    return [sys.executable, "-m", "nlbench", name, path, "--runs", str(runs), "--out", folder, *words]


if __name__ == "__main__":
    main()
