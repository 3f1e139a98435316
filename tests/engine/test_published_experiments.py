"""Claim: the scalar experiments agree with an independent implementation within 5 combined standard errors.

Heavy-tailed filters are compared by clipped RMS, median and counts of divergence, the others by every statistic.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import nlbench as nb
from nlbench import config

PUBLISHED = json.loads((Path(__file__).parents[1] / "golden" / "experiments.json").read_text())
LABELS = {
    "LK": "linearised-kalman",
    "second": "second-order",
    "sub1": "third-order-sub1",
    "sub2": "third-order-sub2",
    "third": "third-order",
    "third_lim3": "limited",
    "third_guard": "third-order-guarded",
    "fourth": "fourth-order",
    "auto4_third_k4zero": "third-order-4",
    "EXACT": "exact",
}
ROBUST = ("rms_clipped", "median_error")
WELL_BEHAVED = ("LK", "second", "sub1", "EXACT", "third_guard")
MEASURED = {"name": "culver-scalar", "measurement": "linear"}
SYSTEMS = {
    "7.1-7.6/M": {"name": "culver-scalar", "measurement": "none"},
    "big/M/dtm=0.1/R=1.6": {**MEASURED, "interval": 0.1, "measurement_variance": 1.6},
    "disc/M/dtm=0.04/R=4": {**MEASURED, "interval": 0.04, "measurement_variance": 4.0},
    "disc/M/dtm=0.02/R=8": {**MEASURED, "interval": 0.02, "measurement_variance": 8.0},
}


@pytest.mark.slow
@pytest.mark.parametrize("group", SYSTEMS)
def test_agrees_with_an_independent_implementation(group, tmp_path):
    values = {name: found for name, found in PUBLISHED[group].items() if name in LABELS}
    named = [LABELS[name] for name in values if name != "EXACT"]
    results = nb.run(
        config.from_dict(
            {
                "experiment": "published",
                "system": SYSTEMS[group],
                "filters": [_entry(label) for label in named],
                **({"reference": "exact"} if "EXACT" in values else {}),
                "time": {"end": 2.0, "step": 0.02, "output": 0.1},
                "report_times": [0.4, 0.5, 1.0, 1.5, 2.0],
                "monte_carlo": {"runs": 20_000, "seed": 20},
            }
        ),
        tmp_path,
    )
    table = results.table("statistics").set_index(["filter", "time", "statistic", "coordinate"])
    compared = 0
    for name, times in values.items():
        everything = group.startswith("7.1") or name in WELL_BEHAVED
        for time, statistics in times.items():
            for statistic, (value, stderr, runs) in statistics.items():
                where = (LABELS[name], str(float(time)), statistic)
                if statistic == "diverged":
                    mine = table.loc[(*where, "all")]
                    _same_rate(mine.value * mine.n, mine.n, value, runs, where)
                elif everything or statistic in ROBUST:
                    mine = table.loc[(*where, "x")]
                    error = math.hypot(mine.stderr, stderr)
                    assert abs(mine.value - value) <= max(5 * error, 1e-5 * abs(value)), where
                else:
                    continue
                compared += 1
    assert compared >= 30 * len(values) / 2


def _entry(label: str) -> dict:
    return {"name": "third-order", "limiter": 3.0, "label": label} if label == "limited" else {"name": label}


def _same_rate(count: float, n: int, other: float, runs: int, where: tuple) -> None:
    rate = max(count + other, 1.0) / (n + runs)
    assert abs(count / n - other / runs) <= 5 * math.sqrt(rate * (1 / n + 1 / runs)), where
