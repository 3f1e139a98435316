"""Claim: all filters of an experiment see the same truth and noise, whichever other filters run beside them."""

from __future__ import annotations

import pandas as pd
import pytest

import nlbench as nb

EXPERIMENT = """# Do all filters see the same runs?
experiment: tests/common-numbers
system: {{name: culver-scalar, interval: 0.1}}
filters: {filters}
time: {{end: 0.4, step: 0.02, output: 0.2}}
monte_carlo: {{runs: 100, seed: 7}}
engine: {{cost: false}}
"""


pytestmark = pytest.mark.slow


def run(folder, filters):
    file = folder / "experiment.yaml"
    file.write_text(EXPERIMENT.format(filters=filters))
    return nb.run(nb.load(file), out=folder / "results")


@pytest.fixture(scope="module")
def together(tmp_path_factory):
    return run(tmp_path_factory.mktemp("together"), "[third-order, linearised-kalman, ekf]")


def test_a_filter_scores_the_same_beside_other_filters(together, tmp_path):
    alone = run(tmp_path, "[ekf]").table("statistics")
    among = together.table("statistics").query("filter == 'ekf'")
    keys = ["filter", "time", "coordinate", "statistic"]
    merged = alone.merge(among, on=keys, suffixes=("_alone", "_among"))
    assert len(merged) == len(alone) > 0
    pd.testing.assert_series_equal(
        merged["value_alone"], merged["value_among"], check_names=False, rtol=1e-12, atol=1e-14
    )


def test_two_names_of_one_filter_never_differ_in_a_run(together):
    """The paired difference of ekf and linearised-kalman is zero in every run, so its standard error is too."""
    names = {"linearised-kalman", "ekf"}
    paired = together.table("paired")
    paired = paired[paired["filter_a"].isin(names) & paired["filter_b"].isin(names)]
    assert len(paired) > 0
    assert (paired["difference"] == 0).all()
    assert (paired["stderr"] == 0).all()
