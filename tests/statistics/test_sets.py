"""Claim: what sets of the source's size would show is what fresh experiments of that size do show."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from nlbench.config import Claim
from nlbench.statistics.comparisons import Quantity
from nlbench.statistics.sets import KeptTable, sets_table

CLIP = {"x": 3.0, "y": np.inf, "both": np.inf}
NORMS = {"both": ["x", "y"]}


def runs_table(spread=(1.0, 1.2), runs=20_000, seed=5, lost=0.0):
    """Errors of filters a and b that share no noise, at time 1, with the variance that they state."""
    draw = np.random.default_rng(seed)
    parts = []
    for label, sigma in zip("ab", spread, strict=True):
        error = sigma * draw.standard_normal((2, runs))
        columns = {"filter": label, "time": 1.0, "run": np.arange(runs), "x": error[0], "y": error[1]}
        for name in "xy":
            columns |= {f"{name}_variance": np.full(runs, sigma**2), f"{name}_third": np.zeros(runs)}
        parts.append(pd.DataFrame({**columns, "diverged": draw.random(runs) < lost}))
    return pd.concat(parts, ignore_index=True)


def claim(**form):
    return Claim(**{"id": "C", "says": "so", "statistic": "rms", "at": [1.0], **form})


@pytest.mark.parametrize("size", [10, 20, 80])
def test_the_share_of_sets_that_show_an_ordering_is_that_of_the_f_distribution(size):
    table = sets_table([claim(less=["a", "b"])], KeptTable(runs_table(), CLIP, NORMS), None)
    row = table.set_index("runs").loc[size]
    expected = stats.f.cdf(1.2**2, size, size)
    assert row["sets"] == 2000
    assert row["share"] == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / 2000))
    assert row["low"] < row["share"] < row["high"]


def test_sets_of_the_sources_size_stand_beside_the_usual_ones_where_there_are_as_many_runs():
    kept = KeptTable(runs_table(runs=50), CLIP, NORMS)
    table = sets_table([claim(less=["a", "b"])], kept, 33)
    assert table["runs"].tolist() == [10, 20, 33]


def test_every_comparison_of_a_claim_must_point_its_way_in_the_same_set():
    kept = KeptTable(runs_table((1.0, 1.0)), CLIP, NORMS)
    both = claim(of=["a", "b"], below=1.0, statistic="rms")
    one = claim(of=["a"], below=1.0, statistic="rms")
    of_both, of_one = (sets_table([each], kept, None).iloc[0]["share"] for each in (both, one))
    assert of_both == pytest.approx(of_one**2, abs=0.05)


def test_all_filters_of_a_set_have_the_same_runs():
    """Where b is always .1 % worse, every set shows it."""
    runs = runs_table()
    first = runs["filter"] == "a"
    runs.loc[~first, ["x", "y"]] = runs.loc[first, ["x", "y"]].to_numpy() * 1.001
    kept = KeptTable(runs, CLIP, NORMS)
    assert (sets_table([claim(less=["a", "b"])], kept, None)["share"] == 1).all()


@pytest.mark.parametrize(
    ("statistic", "coordinate", "formula"),
    [
        ("rms", "x", lambda e, lost: np.sqrt((e[0] ** 2)[~lost].mean())),
        ("rms", "both", lambda e, lost: np.sqrt((e[0] ** 2 + e[1] ** 2)[~lost].mean())),
        (
            "rms_clipped",
            "x",
            lambda e, lost: np.sqrt((np.where(lost, 3, np.minimum(abs(e[0]), 3)) ** 2).mean()),
        ),
        ("median_error", "y", lambda e, lost: np.median(np.where(lost, np.inf, abs(e[1])))),
        ("mean_error", "y", lambda e, lost: e[1][~lost].mean()),
        ("variance_actual", "x", lambda e, lost: e[0][~lost].var()),
        ("third_actual", "x", lambda e, lost: stats.moment(e[0][~lost], 3)),
        ("variance_estimated", "x", lambda e, lost: 1.0),
        ("nees", "x", lambda e, lost: (e[0] ** 2)[~lost].mean()),
        ("coverage_95", "x", lambda e, lost: (abs(e[0][~lost]) <= 1.959964).mean()),
        ("diverged", "all", lambda e, lost: lost.mean()),
    ],
)
def test_a_statistic_of_a_set_is_that_of_its_runs(statistic, coordinate, formula):
    runs = runs_table(runs=500, lost=0.1)
    kept = KeptTable(runs, CLIP, NORMS)
    drawn = kept.drawn(80, 7)
    values = kept.value(Quantity("a", 1.0, coordinate, statistic), drawn)
    rows = runs[runs["filter"] == "a"]
    for number, members in enumerate(drawn):
        chosen = rows.iloc[members]
        expected = formula(chosen[["x", "y"]].to_numpy().T, chosen["diverged"].to_numpy())
        assert values[number] == pytest.approx(expected, rel=1e-12)


def test_statistics_that_are_not_kept_run_by_run_have_no_share():
    kept = KeptTable(runs_table(), CLIP, NORMS)
    assert len(sets_table([claim(of=["a"], statistic="nis", coordinate="all", below=1.0)], kept, None)) == 0
    assert len(sets_table([claim(of=["c"], below=1.0)], kept, None)) == 0


def test_the_draw_depends_on_nothing_but_the_size():
    kept = KeptTable(runs_table(), CLIP, NORMS)
    np.testing.assert_array_equal(kept.drawn(10), kept.drawn(10))
    table = sets_table([claim(less=["a", "b"])], kept, None)
    pd.testing.assert_frame_equal(table, sets_table([claim(less=["a", "b"])], kept, None))


def test_coordinates_stand_in_the_order_of_the_table_however_a_manifest_sorts_them():
    columns = ["filter", "time", "run", "y", "x", "y_variance", "x_variance", "diverged"]
    runs = pd.DataFrame([["a", 1.0, 0, 1.0, 2.0, 1.0, 1.0, False]], columns=columns)
    kept = KeptTable(runs, {"both": 1.0, "x": 1.0, "y": 1.0}, {"both": ["y", "x"]})
    assert kept.coordinates == ["y", "x"]
