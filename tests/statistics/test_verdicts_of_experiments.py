"""Claim: over 2,000 simulated experiments 95 % intervals cover 95 %, and planted claims are told from false ones.

The errors of every experiment are summed as the engine sums them, and go through the same tables and the same
judgement. An output time stands for an experiment: its errors are independent of those at all others. Three filters
share half of their errors' variance; the errors are skewed, with heavier tails than a Gaussian's. The first filter's
are 20 % smaller, those of the other two are alike.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pandas as pd
import pytest

from nlbench.config import Claim
from nlbench.statistics.claims import evaluate
from nlbench.statistics.paired import paired_table
from nlbench.statistics.summary import statistics_table
from tests.statistics import made_runs

EXPERIMENTS = 2000
JUDGED = 500  # of them, since judging takes thirty times as long as computing
AT_ONCE = 250
SCALE = np.array([0.8, 1.0, 1.0])
# With g standard normal and x exponential: (g + x - 1)^k has the means 0, 2, 2 for k = 1, 2, 3.
TRUE = {"mean_error": 0 * SCALE, "rms": np.sqrt(2) * SCALE, "variance_actual": 2 * SCALE**2}
TRUE |= {"rms_clipped": TRUE["rms"], "third_actual": 2 * SCALE**3}


@pytest.fixture(
    scope="module",
    params=[pytest.param(1280, id="delta"), pytest.param(2560, id="jackknife", marks=pytest.mark.long)],
)
def experiments(request):
    """Tables of statistics and of paired differences, an experiment at each time; 1,280 runs fill 20 groups."""
    runs = request.param
    layout = made_runs.layout(filters=3, times=AT_ONCE, clip=(60.0,), keep_runs=0)
    layout = layout._replace(reports=tuple(range(AT_ONCE)), scores=False)
    draw = np.random.default_rng(1969)
    shape = (1, AT_ONCE, 1, runs)
    tables = []
    for number in range(EXPERIMENTS // AT_ONCE):
        common = draw.standard_normal(shape)
        own = draw.exponential(1.0, (3, *shape[1:])) - 1.0
        made = made_runs.make(layout, runs, seed=number, lost=0.0)
        made = made._replace(error=SCALE[:, None, None, None] * (common + own))
        totals = made_runs.total(made, layout)
        for name, table in (("statistics", statistics_table(totals)), ("paired", paired_table(totals))):
            tables.append((name, table[table["coordinate"] == "position"].assign(part=number)))
    joined = {
        name: pd.concat([table for kind, table in tables if kind == name])
        for name in ("statistics", "paired")
    }
    joined["statistics"] = joined["statistics"][joined["statistics"]["time"] != "all"]
    return joined


def coverage(rows, value, truth):
    return (abs(rows[value] - truth) <= 1.959964 * rows["stderr"]).mean()


@pytest.mark.parametrize("statistic", ["mean_error", "rms", "rms_clipped", "variance_actual"])
def test_intervals_of_statistics_cover_as_often_as_they_say(experiments, statistic):
    table = experiments["statistics"]
    rows = table[(table["statistic"] == statistic) & (table["filter"] == "filter 2")]
    assert len(rows) == EXPERIMENTS
    assert 0.935 <= coverage(rows, "value", TRUE[statistic][1]) <= 0.965


@pytest.mark.parametrize("statistic", ["mean_error", "rms", "rms_clipped"])
def test_intervals_of_paired_differences_cover_as_often_as_they_say(experiments, statistic):
    table = experiments["paired"]
    rows = table[(table["statistic"] == statistic) & (table["filter_a"] == "filter 1")]
    rows = rows[rows["filter_b"] == "filter 2"]
    assert len(rows) == EXPERIMENTS
    assert 0.935 <= coverage(rows, "difference", TRUE[statistic][0] - TRUE[statistic][1]) <= 0.965


CLAIMS = {
    "true": {"less": ["filter 1", "filter 2"]},
    "wrong": {"less": ["filter 3", "filter 1"]},
    "nothing to choose": {"less": ["filter 2", "filter 3"]},
    "equal": {"equal": ["filter 2", "filter 3"], "within": 0.2},
    "not equal": {"equal": ["filter 1", "filter 2"], "within": 0.02},
    "true bound": {"of": ["filter 1"], "below": 1.4, "above": 0.9},
    "wrong bound": {"of": ["filter 1"], "above": 1.4},
}


@pytest.fixture(scope="module")
def verdicts(experiments):
    """How often each claim gets each verdict when all of them are judged together."""
    claims = {name: Claim(id=name, says=name, statistic="rms", **form) for name, form in CLAIMS.items()}
    counts = {name: Counter() for name in claims}
    rms = {name: table[table["statistic"] == "rms"] for name, table in experiments.items()}
    paired = dict(iter(rms["paired"].groupby(["part", "time"])))
    judged = rms["statistics"][rms["statistics"]["part"] < JUDGED // AT_ONCE]
    for (part, time), statistics in judged.groupby(["part", "time"]):
        dated = [claim.model_copy(update={"at": [float(time)]}) for claim in claims.values()]
        tables = {"statistics": statistics, "paired": paired[part, float(time)]}
        for row in evaluate(dated, tables).itertuples():
            counts[row.id][row.verdict] += 1
    return counts


@pytest.mark.parametrize("name", ["true", "equal", "true bound"])
def test_a_planted_true_claim_is_confirmed(verdicts, name):
    assert verdicts[name]["confirmed"] >= 0.97 * JUDGED
    assert verdicts[name]["refuted"] == 0


@pytest.mark.parametrize("name", ["wrong", "not equal", "wrong bound"])
def test_a_planted_wrong_claim_is_refuted(verdicts, name):
    assert verdicts[name]["refuted"] >= 0.97 * JUDGED
    assert verdicts[name]["confirmed"] == 0


def test_where_there_is_nothing_to_choose_a_verdict_is_false_in_one_experiment_of_twenty_at_most(verdicts):
    """When all other comparisons are decided, Holm leaves the last one the whole 5 %; 4 standard errors above it."""
    false = verdicts["nothing to choose"]["confirmed"] + verdicts["nothing to choose"]["refuted"]
    assert false <= 0.05 * JUDGED + 4 * np.sqrt(0.05 * 0.95 * JUDGED)
    assert verdicts["nothing to choose"]["undecided"] == JUDGED - false
