"""A baseline: what was measured once, as a JSON file that says with which kernel, libraries and processor."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.errors import ConfigError
from nlbench.perf.counts import COUNTS
from nlbench.perf.verdict import Estimate
from nlbench.results.atomic import atomic_write

if TYPE_CHECKING:
    from nlbench.perf.workloads import Workload

DEFAULT = Path("perf-baseline.json")
SCHEMA = 2


class Entry(NamedTuple):
    """What the baseline says of a workload; experiment: its hash, "" where that was not noted."""

    log_ratio: float
    band: float
    counts: dict[str, float]
    experiment: str = ""


class Baseline(NamedTuple):
    """Entries by workload, and the machine that they were measured on."""

    kernel: str
    machine: dict[str, str]
    entries: dict[str, Entry]


def of(
    kernel: str,
    machine: dict[str, str],
    estimates: Mapping[str, Estimate],
    workloads: Sequence[Workload],
) -> Baseline:
    """The baseline that these measurements of workloads make."""
    entries = {
        each.name: Entry(*estimates[each.name][:2], each.counts, each.experiment) for each in workloads
    }
    return Baseline(kernel, machine, entries)


def refuse_others(path: Path, baseline: Baseline, workloads: Sequence[Workload]) -> None:
    """Raises `ConfigError` where a workload has the name of one in the baseline and is of another experiment."""
    other = [
        each.name
        for each in workloads
        if (known := baseline.entries.get(each.name)) and known.experiment not in ("", each.experiment)
    ]
    if other:
        raise ConfigError(
            f"{path}: was measured on other experiments of the same names ({', '.join(other)}); make a new one with "
            "--record"
        )


def write(path: Path, baseline: Baseline) -> None:
    """Write the file, whole or not at all."""
    entries = {
        name: {
            "ratio": math.exp(each.log_ratio),
            "band": each.band,
            "counts": each.counts,
            "experiment": each.experiment,
        }
        for name, each in baseline.entries.items()
    }
    plain = {"schema": SCHEMA, "kernel": baseline.kernel, "machine": baseline.machine, "workloads": entries}
    atomic_write(path, (json.dumps(plain, indent=2) + "\n").encode())


def read(path: Path, kernel: str) -> Baseline:
    """Raises `ConfigError` for a file that is missing, no baseline, or made with another kernel."""
    try:
        plain = json.loads(path.read_bytes())
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot read the baseline: {(error.strerror or str(error)).lower()}"
        ) from error
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: no baseline: not JSON") from error
    try:
        if plain["schema"] != SCHEMA:
            raise ConfigError(
                f"{path}: schema {plain['schema']!r}; this version reads schema {SCHEMA}: record it again"
            )
        found = Baseline(
            str(plain["kernel"]),
            {str(name): str(value) for name, value in plain["machine"].items()},
            {str(name): _entry(each) for name, each in plain["workloads"].items()},
        )
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise ConfigError(f"{path}: no baseline of `nlbench perf`; make one with --record") from error
    if found.kernel != kernel:
        raise ConfigError(
            f"{path}: measured with reference kernel {found.kernel}, this is {kernel}; make a new one with --record"
        )
    return found


def _entry(plain: Any) -> Entry:
    """Raises `ValueError` where a number cannot be what it says."""
    ratio, band = float(plain["ratio"]), float(plain["band"])
    counts = {name: float(value) for name, value in plain["counts"].items() if name in COUNTS}
    if not (ratio > 0 and band >= 0 and all(map(math.isfinite, (ratio, band, *counts.values())))):
        raise ValueError("not a positive, finite number")
    return Entry(math.log(ratio), band, counts, str(plain.get("experiment", "")))
