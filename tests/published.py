"""Results of runs against published ones of an independent implementation, within 5 combined standard errors."""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from pathlib import Path
from typing import Any

import pandas as pd

# Of filters that diverge now and then, only these and the counts compare.
ROBUST = ("rms_clipped", "median_error")


def published(stem: str) -> dict[str, Any]:
    """[group][filter][time][statistic] = [value, standard error, runs]."""
    return json.loads((Path(__file__).parent / "golden" / f"{stem}.json").read_text())


def report_times(values: dict[str, Any]) -> list[float]:
    """Every time at which a filter of the group is compared."""
    return sorted({float(time) for times in values.values() for time in times})


def assert_agrees(
    table: pd.DataFrame, labels: dict[str, str], values: dict[str, Any], well_behaved: Collection[str]
) -> None:
    """Clipped RMS, medians and counts of divergence of every filter, every statistic of those without heavy tails.

    labels: what the runs call the filters of `values`.
    """
    rows = table.set_index(["filter", "time", "statistic", "coordinate"])
    compared = 0
    for name, label in labels.items():
        for time, statistics in values[name].items():
            for statistic, (value, stderr, runs) in statistics.items():
                where = (label, str(float(time)), statistic)
                if statistic == "diverged":
                    mine = rows.loc[(*where, "all")]
                    _same_rate(mine.value * mine.n, mine.n, value, runs, (name, *where))
                elif name in well_behaved or statistic in ROBUST:
                    mine = rows.loc[(*where, "x")]
                    error = math.hypot(mine.stderr, stderr)
                    assert abs(mine.value - value) <= max(5 * error, 1e-5 * abs(value)), (name, *where)
                else:
                    continue
                compared += 1
    assert compared >= 9 * len(labels)


def _same_rate(count: float, n: int, other: float, runs: int, where: tuple) -> None:
    rate = max(count + other, 1.0) / (n + runs)
    assert abs(count / n - other / runs) <= 5 * math.sqrt(rate * (1 / n + 1 / runs)), where
