"""The measured effect of XLA's options: the same filter in two processes, with and without them."""

from __future__ import annotations

import os
import statistics
import subprocess
import sys

ROUNDS = 2
PROGRAM = """
import os, sys
options = sys.argv[1] == "with"
os.environ.pop("XLA_FLAGS", None)
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
from nlbench import runtime
if not options:
    runtime.XLA_OPTIONS = ()
runtime.configure()
from nlbench import config
from nlbench.engine.cost import cost_table
from nlbench.engine.problem import make
experiment = config.from_dict({
    "experiment": "effect",
    "system": {"name": "culver-scalar"},
    "filters": ["third-order"],
    "time": {"end": 10.0, "step": 0.02, "output": 10.0},
})
print(cost_table(make(experiment), seed=1, threads=1).ns_per_step[0])
"""


def speedup_by_options() -> float:
    """How many times faster the third-order filter of the scalar system runs with the options; takes some seconds.

    Interleaved processes on one core; the ratio of medians.
    """
    times: dict[str, list[float]] = {"with": [], "without": []}
    for _ in range(ROUNDS):
        for which, measured in times.items():
            measured.append(_ns_per_step(which))
    return statistics.median(times["without"]) / statistics.median(times["with"])


def _ns_per_step(which: str) -> float:
    path = os.pathsep.join(entry for entry in sys.path if entry)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, which],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    return float(done.stdout)
