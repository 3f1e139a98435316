"""Small experiments for the tests of the engine, and the bytes of the tables that they make."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from nlbench import config

# Cost is measured, so it is not among them.
STABLE = ("statistics", "moments", "paired", "divergence", "consistency", "runs")


def experiment(**changes: Any) -> config.Experiment:
    """A short scalar experiment with the reference, without costs; `changes` replace top-level keys."""
    plain: dict[str, Any] = {
        "experiment": "small",
        "system": {"name": "culver-scalar", "ensemble": "normal"},
        "filters": ["third-order", "third-order-guarded"],
        "reference": "exact",
        "time": {"end": 0.6, "step": 0.02, "output": 0.1},
        "report_times": [0.2, 0.6],
        "monte_carlo": {"runs": 1000, "seed": 11},
    }
    engine = {"cost": False, **changes.pop("engine", {})}
    return config.from_dict({**plain, **changes, "engine": engine})


def table_bytes(folder: Path) -> dict[str, bytes]:
    """Every file of the tables that must not change by a byte."""
    files = sorted((folder / "tables").iterdir())
    return {file.name: file.read_bytes() for file in files if file.stem in STABLE}


def python(
    program: str, *arguments: str, xla_flags: str | None = None, **options: Any
) -> subprocess.CompletedProcess:
    """Run a program in a process of its own, with all of XLA's threads; it compiles as the tests do, unless said."""
    plain = {name: value for name, value in os.environ.items() if name != "PJRT_NPROC"}
    environment = {
        **plain,
        "PYTHONPATH": os.pathsep.join(filter(None, sys.path)),
        "XLA_FLAGS": os.environ.get("XLA_FLAGS", "") if xla_flags is None else xla_flags,
    }
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        capture_output=True,
        text=True,
        env=environment,
        **options,
    )
