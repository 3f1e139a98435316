"""Claim: moments that a source prints are believed unless so few runs could hardly have given them."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nlbench.config import Claim
from nlbench.statistics.claims import evaluate
from nlbench.statistics.sets import KeptTable
from tests.statistics.test_claims import PAIRED

RUNS = 20_000
COV = np.array([[4.0, 1.5], [1.5, 1.0]])
EMPTY = {
    "statistics": pd.DataFrame(
        [("a", "1.0", "x", "rms", 1.0, 0.1, RUNS)],
        columns=["filter", "time", "coordinate", "statistic", "value", "stderr", "n"],
    ),
    "paired": pd.DataFrame(columns=PAIRED),
}


@pytest.fixture(scope="module")
def kept():
    error = np.random.default_rng(3).multivariate_normal([0.0, 0.0], COV, RUNS)
    runs = pd.DataFrame({"filter": "a", "time": 1.0, "x": error[:, 0], "y": error[:, 1], "diverged": False})
    return KeptTable(runs, {"x": np.inf, "y": np.inf}, {})


def moments():
    """The filter states the true covariance, by single runs with a spread of 20 %."""
    rows = [
        ("a", 1.0, indices, value, value, 0.01 * value, RUNS, 0.2 * value / np.sqrt(RUNS))
        for indices, value in (("1,1", 4.0), ("1,2", 1.5), ("2,2", 1.0))
    ]
    names = ["filter", "time", "indices", "estimated", "actual", "stderr", "n", "estimated_stderr"]
    return pd.DataFrame(rows, columns=names)


def judged(kept, printed, statistic, runs=10):
    claim = Claim(id="C", says="so", at=[1.0], of=["a"], statistic=statistic, printed=printed)
    return evaluate([claim], {**EMPTY, "moments": moments()}, kept, runs).iloc[0]


@pytest.mark.parametrize(
    ("printed", "verdict"),
    [
        ({"1,1": 4.0, "1,2": 1.5, "2,2": 1.0}, "confirmed"),
        ({"1,1": 4.4}, "confirmed"),  # 10 %: 1.6 standard errors of ten runs
        ({"1,1": 5.2}, "refuted"),  # 30 %: 4.7
        ({"1,1": 4.0, "2,2": 0.7}, "refuted"),
    ],
)
def test_an_estimated_moment_may_scatter_as_a_mean_over_the_sources_runs(kept, printed, verdict):
    assert judged(kept, printed, "moment_estimated")["verdict"] == verdict


@pytest.mark.parametrize(
    ("printed", "verdict"),
    [
        ({"1,1": 2.0, "1,2": 0.9, "2,2": 0.6}, "confirmed"),  # of ten runs a variance scatters by 45 %
        ({"1,1": 0.2}, "refuted"),
        ({"1,1": 18.0}, "refuted"),
        ({"1,2": -1.5}, "refuted"),
    ],
)
def test_an_actual_moment_may_scatter_as_that_of_the_sources_runs(kept, printed, verdict):
    assert judged(kept, printed, "moment_actual")["verdict"] == verdict


def test_moments_of_fresh_sets_of_ten_runs_are_hardly_ever_refuted(kept):
    """Three numbers at a level of 5 % in all; 4 standard errors above it."""
    draw, refuted = np.random.default_rng(8), 0
    for _ in range(300):
        set_cov = np.cov(draw.multivariate_normal([0.0, 0.0], COV, 10).T, bias=True)
        printed = {"1,1": set_cov[0, 0], "1,2": set_cov[0, 1], "2,2": set_cov[1, 1]}
        refuted += judged(kept, printed, "moment_actual")["verdict"] == "refuted"
    assert refuted <= 300 * 0.05 + 4 * np.sqrt(300 * 0.05 * 0.95)


def test_numbers_without_a_known_number_of_runs_or_without_a_moment_decide_nothing(kept):
    assert judged(kept, {"1,1": 4.0}, "moment_actual", runs=None)["verdict"] == "undecided"
    assert judged(kept, {"1,1,1": 4.0}, "moment_estimated")["verdict"] == "undecided"


def test_the_estimate_is_that_of_the_number_that_fits_least(kept):
    row = judged(kept, {"1,1": 4.1, "2,2": 0.8}, "moment_estimated")
    assert row["estimate"] == pytest.approx(-0.2)
