"""Claim: the oscillator experiments agree with an independent implementation within 5 combined standard errors.

Filters whose errors have heavy tails are compared by clipped RMS, median and counts of divergence, the others by every
statistic. A run is diverged from the first report time at which it was found so.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import nlbench as nb
from nlbench import config

PUBLISHED = json.loads((Path(__file__).parents[1] / "golden" / "oscillator.json").read_text())
NAMES = {
    "LK": "linearised-kalman",
    "second": "second-order",
    "sub1": "third-order-sub1",
    "sub2": "third-order-sub2",
    "third": "third-order",
    "third_guard": "third-order-guarded",
}
ROBUST = ("rms_clipped", "median_error")
WELL_BEHAVED = ("LK", "second", "sub1", "LK_lim3", "second_lim3", "sub1_lim3", "EXACT")
DAMPING_VARIANCES = {"8.4-8.6/M": 0.16, "8.7-8.9/M": 0.09}
LIMITED = ("third_lim3", "third_lim1")
RUNS = 20_000


@pytest.mark.long
@pytest.mark.parametrize("group", DAMPING_VARIANCES)
def test_agrees_with_an_independent_implementation(group, tmp_path):
    labels = dict.fromkeys(label for label, *_ in PUBLISHED[group] if label not in LIMITED)
    compared, apart = compare(group, list(labels), tmp_path)
    assert not apart
    assert compared > 1000


@pytest.mark.long
@pytest.mark.parametrize("group", DAMPING_VARIANCES)
def test_the_limited_third_order_agrees_with_an_independent_implementation(group, tmp_path):
    compared, apart = compare(group, list(LIMITED), tmp_path)
    assert not apart
    assert compared > 80


def compare(group, labels, folder):
    """How many published values were compared, and those that are more than 5 standard errors away."""
    results = nb.run(
        config.from_dict(
            {
                "experiment": "published",
                "system": {"name": "oscillator", "damping_variance": DAMPING_VARIANCES[group]},
                "filters": [_entry(label) for label in labels if label != "EXACT"],
                **({"reference": "exact"} if "EXACT" in labels else {}),
                "time": {"end": 10.0, "step": 0.05, "output": 0.1},
                "report_times": [0.2, 0.5, 1.0, 1.5, 2.0, 5.0, 10.0],
                "monte_carlo": {"runs": RUNS, "seed": 21},
            }
        ),
        folder,
    )
    table = results.table("statistics").set_index(["filter", "time", "statistic", "coordinate"])
    compared, apart = 0, []
    for label, coordinate, time, statistics in PUBLISHED[group]:
        if label not in labels:
            continue
        for statistic, (value, stderr, runs) in statistics.items():
            where = ("exact" if label == "EXACT" else label, str(float(time)), statistic)
            if statistic == "diverged":
                if coordinate != "position":  # the same count stands with every coordinate
                    continue
                mine = table.loc[(*where, "all")]
                z = _of_rates(mine.value * mine.n, mine.n, value, runs)
            elif label in WELL_BEHAVED or statistic in ROBUST:
                mine = table.loc[(*where, coordinate)]
                off = abs(mine.value - value)
                error = math.hypot(mine.stderr, stderr)
                z = 0.0 if off <= 1e-5 * abs(value) else off / error
            else:
                continue
            compared += 1
            if not z <= 5:
                apart.append((*where, coordinate, mine.value, value, z))
    return compared, apart


def _entry(label: str) -> dict:
    name, _, limit = label.partition("_lim")
    return {"name": NAMES[name], "label": label, **({"limiter": float(limit)} if limit else {})}


def _of_rates(count: float, n: int, other: float, runs: int) -> float:
    rate = max(count + other, 1.0) / (n + runs)
    return abs(count / n - other / runs) / math.sqrt(rate * (1 / n + 1 / runs))
