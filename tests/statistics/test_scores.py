"""NIS and log-likelihood in the table of statistics: standard errors of a ratio over runs, and what is not there."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nlbench.statistics import accumulate
from nlbench.statistics.summary import statistics_table
from nlbench.statistics.totals import Totals
from tests.statistics import made_runs


def table(layout, runs):
    return made_runs.keyed(statistics_table(made_runs.total(runs, layout)))


@pytest.mark.parametrize("statistic", ["nis", "log_likelihood"])
@pytest.mark.parametrize("runs", [1000, 20_000], ids=["delta", "jackknife"])
def test_standard_errors_equal_the_spread_over_repetitions(statistic, runs):
    """Two hundred times stand for repetitions; runs differ in how many samples they have."""
    layout = made_runs.layout(filters=1, times=201, clip=(1.2,))
    made = made_runs.make(layout, runs, seed=8, lost=0.0)
    rng = np.random.default_rng(3)
    made = made._replace(log_likelihood=rng.normal(-300.0, 4.0, made.log_likelihood.shape))
    rows = [row for key, row in table(layout, made).items() if key[3] == statistic and key[1] != "all"]
    assert len(rows) == 200
    spread = np.std([row.value for row in rows], ddof=1)
    # The spread of 200 values is itself known to 5 %.
    assert np.sqrt(np.mean([row.stderr**2 for row in rows])) == pytest.approx(spread, rel=0.2)


def test_samples_of_one_run_need_not_be_independent():
    """Runs whose samples are all alike: the standard error is that of as many samples as there are runs."""
    layout = made_runs.layout(filters=1)
    made = made_runs.make(layout, 800, seed=4, lost=0.0)
    level = np.random.default_rng(5).chisquare(2, made.nis.shape)
    samples = np.where(np.arange(4)[:, None] > 0, 5, 0) * np.ones_like(made.samples)
    row = table(layout, made._replace(nis=level * samples, samples=samples))["filter 1", "1.0", "all", "nis"]
    assert row.n == 5 * 800
    assert row.stderr == pytest.approx(np.std(level[0, 2], ddof=1) / np.sqrt(800), rel=1e-9)


def test_a_time_without_samples_has_no_row():
    layout = made_runs.layout()
    made = made_runs.make(layout, 100, seed=6)
    made.samples[:, 2], made.nis[:, 2] = 0, 0.0
    assert {key[1] for key in table(layout, made) if key[3] == "nis"} == {"0.5", "1.5", "all"}


def test_a_filter_that_is_lost_has_no_samples_and_leaves_the_others_alone():
    layout = made_runs.layout()
    made = made_runs.make(layout, 300, seed=9)
    before = table(layout, made)
    made.diverged[1] = True
    made.nis[1] = np.nan
    after = table(layout, made)
    for key, row in after.items():
        if key[3] in ("nis", "log_likelihood"):
            if key[0] == "filter 2":
                assert row.n == 0
                assert np.isnan(row.value)
            else:
                assert row.value == before[key].value


def test_without_scores_there_are_no_rows_of_them():
    layout = made_runs.layout(filters=1)
    totals = Totals(layout)
    for number, (tracks, mask) in enumerate(made_runs.blocks(made_runs.make(layout, 100, seed=1))):
        tracks = tracks._replace(scores=None)
        sums = accumulate.block_sums(*jax.tree.map(jnp.asarray, (tracks, mask)), layout)
        totals.add(number, made_runs.stacked([sums]))
    assert not set(statistics_table(totals)["statistic"]) & {"nis", "log_likelihood"}
