"""Claims: a precision chooses the runs that textbook formulas give, whatever was computed before, and keeps its word;
what cannot be asked for is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

import nlbench as nb
from nlbench import engine
from nlbench.config.precision import Precision, parse
from nlbench.engine.planning import precision
from nlbench.errors import ConfigError
from nlbench.statistics.kept import Reported
from nlbench.statistics.layout import Layout
from tests.small_runs import experiment, table_bytes

HALF_NORMAL_MEDIAN = 0.674489750196082
HALF_NORMAL_DENSITY = 2 * math.exp(-(HALF_NORMAL_MEDIAN**2) / 2) / math.sqrt(2 * math.pi)  # there
N = 4096
CHEAP = {
    "reference": None,
    "filters": ["linearised-kalman"],
    "time": {"end": 0.2, "step": 0.02, "output": 0.1},
    "report_times": [0.2],
}


def layout(clip=math.inf, keep_runs=20_000, filters=1):
    names = tuple(f"filter {number}" for number in range(filters))
    return Layout(names, (0.0, 1.0), (1,), ("x",), ("",), (clip,), {}, keep_runs)


def reported(error, variance=None, lost=None):
    error = np.asarray(error, float)
    full = error[:, None, None]
    variance = np.ones_like(full) if variance is None else variance[:, None, None]
    lost = np.zeros((len(error), 1, error.shape[-1]), bool) if lost is None else lost[:, None]
    return Reported(full, variance.astype(np.float32), np.zeros_like(full, np.float32), lost)


class Totals:
    """Totals that hold these runs and nothing else."""

    def __init__(self, runs, of):
        self.layout, self.kept = of, type("Kept", (), {"runs": runs})


def gaussian(seed, count=N):
    return np.random.default_rng(seed).normal(0.0, 3.0, (1, count))


@pytest.mark.parametrize(
    ("statistic", "expected", "within"),
    [
        ("rms", 1 / math.sqrt(2 * N), 0.1),
        ("rms_clipped", 1 / math.sqrt(2 * N), 0.1),  # nothing is as large as its clip
        ("mean_error", 1 / math.sqrt(N), 0.01),
        ("variance_actual", math.sqrt(2 / N), 0.1),
        # sd of a median is 1 / (2 density sqrt n); the interval's ends are order statistics, hence the width.
        ("median_error", 1 / (2 * HALF_NORMAL_DENSITY) / HALF_NORMAL_MEDIAN / math.sqrt(N), 0.2),
    ],
)
def test_the_standard_error_is_that_of_the_textbook_for_gaussian_errors(statistic, expected, within):
    share, names = precision.relative_errors(statistic, reported(gaussian(1)), layout(clip=60.0))
    assert names == ("x",)
    assert share[0, 0, 0] == pytest.approx(expected, rel=within)


def test_the_standard_error_of_a_variance_that_a_filter_states_is_that_of_a_mean():
    variance = np.random.default_rng(2).exponential(5.0, (1, N))  # whose standard deviation is its mean
    share, _ = precision.relative_errors("variance_estimated", reported(gaussian(1), variance), layout())
    assert share[0, 0, 0] == pytest.approx(1 / math.sqrt(N), rel=0.05)


def test_lost_runs_are_left_out_of_rms_and_count_as_the_clip_when_clipped():
    error = np.tile([1.0, -1.0, 1.0, 0.5], N // 4)[None]
    lost = np.abs(error) < 1
    runs = reported(error, lost=lost)
    plain, _ = precision.relative_errors("rms", runs, layout(clip=2.0))
    assert plain[0, 0, 0] == 0
    clipped, _ = precision.relative_errors("rms_clipped", runs, layout(clip=2.0))
    # Squares 1, 1, 1, 4: mean 7/4, variance 27/16.
    assert clipped[0, 0, 0] == pytest.approx(math.sqrt(27 / 16) / (2 * 7 / 4) / math.sqrt(N), rel=1e-3)


def test_the_runs_chosen_for_gaussian_errors_are_those_of_the_formula_with_its_margin():
    chosen = precision.needed(Precision("rms", 0.01), Totals(reported(gaussian(3)), layout()), block=64)
    assert chosen.runs == pytest.approx(precision.MARGIN * 5000, rel=0.15)
    assert chosen.runs % 64 == 0


def test_the_worst_filter_decides_and_one_without_a_number_is_named():
    heavy = np.random.default_rng(4).standard_t(5, (1, N))
    error = np.concatenate([gaussian(3), heavy, gaussian(5)])
    lost = np.zeros(error.shape, bool)
    lost[2] = True
    three = layout(filters=3)
    chosen = precision.needed(Precision("rms", 0.01), Totals(reported(error, lost=lost), three), block=64)
    assert (chosen.filter, chosen.left_out) == ("filter 1", ("filter 2",))


def test_the_precision_is_kept_in_at_least_nineteen_of_twenty_experiments():
    """Of the runs chosen, not of the pilot, the RMS error's standard error is 1 / sqrt(2 N)."""
    kept = 0
    for seed in range(200):
        totals = Totals(reported(gaussian(seed, precision.FEWEST)), layout(keep_runs=0))
        kept += 1 / math.sqrt(2 * precision.needed(Precision("rms", 0.008), totals, 64).runs) <= 0.008
    assert kept >= 190


def test_the_runs_chosen_say_nothing_about_the_side_on_which_the_statistic_errs():
    """Two-stage sampling: the mean over 400 experiments, pilot and second stage, is the truth within its error."""
    estimates = []
    for seed in range(400):
        pilot = gaussian(seed, precision.FEWEST)
        runs = precision.needed(
            Precision("rms", 0.012), Totals(reported(pilot), layout(keep_runs=0)), 64
        ).runs
        more = np.random.default_rng((seed, 1)).normal(0.0, 3.0, runs - precision.FEWEST)
        estimates.append(math.sqrt(np.mean(np.concatenate([pilot[0], more]) ** 2)) / 3)
    error = np.std(estimates) / math.sqrt(len(estimates))
    assert abs(np.mean(estimates) - 1) < 4 * error


def test_more_runs_than_can_be_made_are_refused_with_what_can_be_reached():
    totals = Totals(reported(gaussian(3)), layout())
    with pytest.raises(ConfigError, match=r"needs about 6\.\de\+09 runs.* rms:0\.002\d% can be reached"):
        precision.needed(Precision("rms", 1e-5), totals, 64)


def test_no_finite_statistic_at_all_is_refused():
    lost = np.ones((1, N), bool)
    with pytest.raises(ConfigError, match="no filter has a finite rms"):
        precision.needed(Precision("rms", 0.01), Totals(reported(gaussian(3), lost=lost), layout()), 64)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rms", "expected STATISTIC:PERCENT%, such as rms:1%"),
        ("rsm:1%", "did you mean 'rms'"),
        ("nees:1%", "no precision can be asked of 'nees'"),
        ("rms:1", "expected a percentage from 0.001% to 50%, with its sign"),
        ("rms:-1%", "expected a percentage"),
        ("rms:nan%", "expected a percentage"),
        ("rms:0%", "expected a percentage"),
    ],
)
def test_a_bad_spelling_is_refused_with_what_is_allowed(text, said):
    with pytest.raises(ConfigError) as refused:
        parse(text)
    assert said in str(refused.value)


def test_everything_wrong_with_a_precision_is_said_at_once():
    with pytest.raises(ConfigError) as refused:
        parse("nees:many")
    assert len(refused.value.problems) == 2


def test_plan_and_run_choose_the_same_whatever_was_computed_before_and_the_pilot_counts(tmp_path):
    asked, stated = Precision("rms", 0.02), experiment(**CHEAP)
    fresh = precision.choose(stated, asked, tmp_path / "fresh")
    exact = experiment(**CHEAP, monte_carlo={"runs": fresh.runs, "seed": 11})
    seen = []
    after_pilot = nb.run(exact, tmp_path / "fresh", progress=lambda done, total: seen.append(done))
    assert seen[0] == fresh.pilot
    at_once = nb.run(exact, tmp_path / "once")
    assert table_bytes(after_pilot.path) == table_bytes(at_once.path)
    planned = engine.plan(stated, tmp_path / "once", str(asked))
    assert (planned["precision"]["runs"], planned["precision"]["share"]) == (fresh.runs, fresh.share)
    assert planned["blocks_left"] == 0
    found = precision.reached(asked, at_once.table("statistics"), stated.report_times)
    assert found == pytest.approx(fresh.share * math.sqrt(fresh.pilot / fresh.runs), rel=0.2)
