"""`python -m benchmarks`: time nlbench against C kernels, plain jax and other libraries."""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

TABLES = ("scalar", "oscillator", "orbit", "libraries")


def main() -> None:
    """Parse, time, print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "tables", nargs="*", metavar="TABLE", help=f"any of {', '.join(TABLES)}; default: all"
    )
    parser.add_argument(
        "--rounds", type=int, default=21, help="interleaved rounds (at least 15 for numbers to be told)"
    )
    parser.add_argument("--core", type=int, help="core to run on (default: the last one of this process)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write one line of JSON per row")
    options = parser.parse_args()
    for unknown in set(options.tables) - set(TABLES):
        parser.error(f"no table '{unknown}'; there are {', '.join(TABLES)}")
    core = pin(options.core)

    from nlbench import runtime

    runtime.configure(precision="float64", threads=1)
    machine = describe(core)
    print(
        f"{machine['processor']}, core {core}, load {machine['load']:.2f}; {options.rounds} rounds, float64"
    )
    lines = []
    with empty_cache():
        for name in options.tables or TABLES:
            lines += timed(name, options.rounds)
    if options.json:
        options.json.write_text("".join(json.dumps(line) + "\n" for line in [machine, *lines]))


def timed(name: str, rounds: int) -> list[dict[str, Any]]:
    """One table, by its name in `TABLES`."""
    from benchmarks import ours, peers, rows, table, workloads

    if name == "libraries":
        libraries = [ours.ekf, rows.plain_ekf, peers.dynamax, peers.cuthbert, peers.filterpy]
        return table.measure(workloads.OSCILLATOR, libraries, rounds)
    filters = [rows.c_filter, rows.c_peak, ours.third_order, rows.plain_third_order]
    whole = [rows.c_experiment, ours.simulated, ours.engine]
    if name == "orbit":
        return table.measure(workloads.ORBIT, filters + whole, rounds)
    orders = [rows.c_second, ours.second_order]
    workload, published = {
        "scalar": (workloads.SCALAR, 2.0),
        "oscillator": (workloads.OSCILLATOR_THIRD, 5.2),
    }[name]
    return table.measure(workload, filters + whole + orders, rounds, published)


@contextmanager
def empty_cache() -> Iterator[None]:
    """An empty folder for nlbench's compiled programs, so that compile times are those of a first run."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NLBENCH_CACHE"] = folder
        yield


def pin(core: int | None) -> int | None:
    """Keep this process, and so XLA's threads, on one core; None where the system cannot."""
    if not hasattr(os, "sched_setaffinity"):
        return None
    chosen = max(os.sched_getaffinity(0)) if core is None else core
    os.sched_setaffinity(0, {chosen})
    return chosen


def describe(core: int | None) -> dict[str, Any]:
    """What the numbers depend on."""
    import jaxlib

    return {
        "processor": processor(),
        "core": core,
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "jaxlib": jaxlib.__version__,
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
    }


def processor() -> str:
    """What the processor calls itself."""
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


if __name__ == "__main__":
    main()
