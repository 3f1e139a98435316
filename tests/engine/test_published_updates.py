"""Claim: experiments with the thesis's other updates agree with an independent implementation within 5 standard errors.

Its corrected two-step update of third order closes the sixth moment with 10{S S}, as printed: with the cumulants.
"""

from __future__ import annotations

import pytest

import nlbench as nb
from nlbench import config
from tests.published import assert_agrees, published, report_times

PUBLISHED = published("experiments_updates")
PRINTED = {"equations": "printed"}
ENTRIES = {
    "series3_printed": {"name": "series-3", **PRINTED},
    "series3_corrected": {"name": "series-3"},
    "series4_printed": {"name": "series-4", **PRINTED},
    "series4_corrected": {"name": "series-4"},
    "intupd_G21": {"name": "integration-update", **PRINTED},
    "intupd_WZ": {"name": "integration-update"},
    "third_lim1": {"name": "third-order", "limiter": 1.0},
    "LK_lin": {"name": "linearised-kalman"},
    "second_lin": {"name": "second-order"},
    "third_lin": {"name": "third-order"},
    "third_lin_lim3": {"name": "third-order", "limiter": 3.0},
    "twostep2": {"name": "two-step-2"},
    "twostep3_printed": {"name": "two-step-3", **PRINTED},
    "twostep3_corrected": {"name": "two-step-3", "closure": "cumulant"},
    "twostep3_corrected_lim3": {"name": "two-step-3", "closure": "cumulant", "limiter": 3.0},
    "direct2": {"name": "direct-2"},
    "direct3": {"name": "direct-3"},
}
QUADRATIC = {
    "name": "culver-scalar",
    "measurement": "quadratic",
    "interval": 0.1,
    "measurement_variance": 1.6,
}
SYSTEMS = {
    "disc/M/dtm=0.04/R=4": {"name": "culver-scalar", "interval": 0.04, "measurement_variance": 4.0},
    "disc/M/dtm=0.02/R=8": {"name": "culver-scalar", "interval": 0.02, "measurement_variance": 8.0},
    "7.26-7.30/M/linear-2/dtm=0.1/R=1.6": {**QUADRATIC, "dynamics": "linear", "decay": 2.0},
    "7.26-7.30/M/nonlinear/dtm=0.1/R=1.6": QUADRATIC,
}
WELL_BEHAVED = ("EXACT", "LK_lin", "second_lin", "twostep2", "direct2")


@pytest.mark.long
@pytest.mark.parametrize("group", SYSTEMS)
def test_agrees_with_an_independent_implementation(group, tmp_path):
    values = PUBLISHED[group]
    labels = {name: name for name in values if name != "EXACT"}
    reference = {"reference": "exact"} if "EXACT" in values else {}
    results = nb.run(
        config.from_dict(
            {
                "experiment": "published",
                "system": SYSTEMS[group],
                "filters": [{**ENTRIES[name], "label": name} for name in labels],
                "time": {"end": 2.0, "step": 0.02, "output": 0.1},
                "report_times": report_times(values),
                "monte_carlo": {"runs": 20_000, "seed": 7},
                **reference,
            }
        ),
        tmp_path,
    )
    labels |= {"EXACT": "exact"} if reference else {}
    assert_agrees(results.table("statistics"), labels, values, WELL_BEHAVED)
