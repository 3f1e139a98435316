"""Claim: the scalar experiments agree with an independent implementation within 5 combined standard errors.

Heavy-tailed filters are compared by clipped RMS, median and counts of divergence, the others by every statistic.
"""

from __future__ import annotations

import pytest

import nlbench as nb
from nlbench import config
from tests.published import assert_agrees, published, report_times

PUBLISHED = published("experiments")
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
WELL_BEHAVED = ("LK", "second", "sub1", "EXACT", "third_guard")
MEASURED = {"name": "culver-scalar", "measurement": "linear"}
SYSTEMS = {
    "7.1-7.6/M": {"name": "culver-scalar", "measurement": "none"},
    "big/M/dtm=0.1/R=1.6": {**MEASURED, "interval": 0.1, "measurement_variance": 1.6},
    "disc/M/dtm=0.04/R=4": {**MEASURED, "interval": 0.04, "measurement_variance": 4.0},
    "disc/M/dtm=0.02/R=8": {**MEASURED, "interval": 0.02, "measurement_variance": 8.0},
}


@pytest.mark.slow
@pytest.mark.parametrize(
    "group",
    [pytest.param(each, marks=() if each.startswith("big") else pytest.mark.long) for each in SYSTEMS],
)
def test_agrees_with_an_independent_implementation(group, tmp_path):
    values = {name: found for name, found in PUBLISHED[group].items() if name in LABELS}
    labels = {name: LABELS[name] for name in values}
    results = nb.run(
        config.from_dict(
            {
                "experiment": "published",
                "system": SYSTEMS[group],
                "filters": [_entry(label) for name, label in labels.items() if name != "EXACT"],
                **({"reference": "exact"} if "EXACT" in values else {}),
                "time": {"end": 2.0, "step": 0.02, "output": 0.1},
                "report_times": report_times(values),
                "monte_carlo": {"runs": 20_000, "seed": 20},
                "engine": {"cost": False},
            }
        ),
        tmp_path,
    )
    well_behaved = labels if group.startswith("7.1") else WELL_BEHAVED
    assert_agrees(results.table("statistics"), labels, values, well_behaved)


def _entry(label: str) -> dict:
    return {"name": "third-order", "limiter": 3.0, "label": label} if label == "limited" else {"name": label}
