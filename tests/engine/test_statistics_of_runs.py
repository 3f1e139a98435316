"""Claims: the tables are what a plain loop over the same trajectories finds; overrides reach data and filters."""

from __future__ import annotations

import math
from html import unescape
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import report
from nlbench.cli import summary
from nlbench.engine.block import words
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.judge import judge
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.filters import derivatives
from nlbench.results.reasons import told
from nlbench.simulate import Trajectory, seed_key, simulate
from nlbench.statistics.layout import Layout
from tests.small_runs import experiment


def rows(results, statistic, time, name="x"):
    table = results.table("statistics")
    chosen = table[(table.statistic == statistic) & (table.time == time) & (table.coordinate == name)]
    return chosen.set_index("filter").value


@pytest.fixture(scope="module")
def matched(tmp_path_factory):
    return nb.run(
        experiment(system={"name": "culver-scalar"}, monte_carlo={"runs": 200, "seed": 5}),
        tmp_path_factory.mktemp("matched"),
    )


def test_every_trajectory_is_the_filter_applied_to_the_simulation(matched):
    """The oracle: init, predict and update, one trajectory after the other, through the public interface."""
    problem = make(matched.experiment)
    key = seed_key(*words(5))
    simulated = jax.jit(lambda number: simulate(problem.truth, problem.schedule, key, number))
    system = nb.systems.build("culver-scalar")
    f = nb.filters.build("third-order", system)

    @jax.jit
    def followed(y):
        state, t, means = f.init(system.initial), 0.0, []
        for k in range(6):
            state = f.predict(state, t, t + 0.1)
            t += 0.1
            state, _ = f.update(state, t, y[k])
            means.append(f.moments(state).mean[0])
        return means[1], means[5]

    kept = matched.table("runs")
    kept = kept[kept["filter"] == "third-order"].set_index(["run", "time"]).x
    for number in range(0, 200, 23):
        states, y, *_ = simulated(Trajectory(*words(number), *words(number), np.int32(0)))
        early, late = followed(y)
        assert kept[number, 0.2] == pytest.approx(float(states[2, 0] - early), rel=1e-9, abs=1e-12)
        assert kept[number, 0.6] == pytest.approx(float(states[6, 0] - late), rel=1e-9, abs=1e-12)


def test_rms_and_median_are_those_of_the_kept_runs(matched):
    kept = matched.table("runs")
    for label, errors in kept[kept.time == 0.6].groupby("filter").x:
        assert rows(matched, "rms", "0.6")[label] == pytest.approx(math.sqrt((errors**2).mean()), rel=1e-12)
        assert rows(matched, "median_error", "0.6")[label] == pytest.approx(errors.abs().median(), rel=1e-12)


def test_replay_shows_the_run_that_the_tables_hold(matched):
    kept = matched.table("runs")
    kept = kept[(kept["filter"] == "third-order-guarded") & (kept.run == 77)].set_index("time").x
    from nlbench import engine

    shown = engine.replay(matched.experiment, "third-order-guarded", 77).set_index("time")
    for time in (0.2, 0.6):
        assert shown.x_truth[time] - shown.x_mean[time] == kept[time]  # to the last bit: the same executable
    assert np.isnan(shown.y1[0.0])
    assert np.isfinite(shown.y1[0.1:]).all()


def test_escaped_runs_are_counted_and_leave_the_others_finite(tmp_path):
    results = nb.run(
        experiment(time={"end": 2.0, "step": 0.02, "output": 0.5}, report_times=[2.0], filters=["second-order"],
                   reference=None, monte_carlo={"runs": 4000, "seed": 3}),
        tmp_path,
    )  # fmt: skip
    row = results.table("divergence").iloc[0]
    expected = 0.0114 * 4000  # escapes before t = 2
    assert (
        abs(row.diverged - expected) < 5 * math.sqrt(expected) + 60
    )  # and runs whose filter is lost beside them
    assert row.diverged >= expected - 4 * math.sqrt(expected)
    assert np.isfinite(rows(results, "rms", "2.0")["second-order"])


def test_truth_model_and_initial_reach_where_they_should(tmp_path):
    base = experiment(
        system={"name": "culver-scalar", "dynamics": "linear", "decay": 1.0},
        truth={"decay": 2.0},
        filters=[
            "linearised-kalman",
            {"name": "linearised-kalman", "label": "knows", "model": {"decay": 2.0}},
            {"name": "linearised-kalman", "label": "biased", "initial": {"mean": [3.0]}},
        ],
    )
    results = nb.run(base, tmp_path)
    start = rows(results, "mean_error", "0.0")
    assert start["biased"] == pytest.approx(start["knows"] - 1.0, abs=1e-12)
    late = rows(results, "rms", "0.6")
    assert late["knows"] == pytest.approx(late["exact"], rel=1e-2)
    assert late["linearised-kalman"] > 1.5 * late["knows"]


def test_initial_moments_of_a_wrong_size_are_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"mean"):
        nb.run(experiment(initial={"mean": [1.0, 2.0], "variance": [1.0, 1.0]}), tmp_path)
    assert not any(tmp_path.iterdir())


EXPLODING = {
    "system": {
        "name": "culver-scalar",
        "ensemble": "matched",
        "measurement": "linear",
        "interval": 0.5,
        "measurement_variance": 0.32,
    },
    "filters": ["third-order-sub1"],
    "reference": None,
    "time": {"end": 1.5, "step": 0.02, "output": 0.1},
    "report_times": [0.5, 1.0, 1.5],
    "monte_carlo": {"runs": 40_000, "seed": 411},
}


def test_a_covariance_that_was_beyond_all_sense_before_a_measurement_is_a_divergence_for_good():
    """Run 21,097 explodes just before t = 1; what the measurement makes of it is rounding, near the truth or not."""
    compiled = compile_chunks(make(experiment(**EXPLODING)), 411)
    block, lane = divmod(21_097, 64)
    view, sums = compiled.view(21_097), compiled.sums(block, 1, 40_000)
    assert view.diverged[0][10:].all()
    assert not view.diverged[0][:9].any()
    assert sums["report_lost"][0, 0, :, lane].tolist() == [False, True, True]
    assert sums["alive"][0, 0, [5, 10, 15]].tolist() == [64, 63, 63]
    assert sums["first_lost"][0, 0].tolist() == [0, 1, 0]
    assert np.abs(sums["mean"][0, 1]).max() < 1.0  # of the variances stated
    nis, likelihood = sums["nis"][0], sums["log_likelihood"][0]
    assert nis[1, 0, [4, 9, 14]].tolist() == [64, 63, 63]
    assert nis[2].max() < 1e3
    assert np.abs(likelihood[1]).max() < 1e3


class Stated(NamedTuple):
    """What a filter states of two states that are zero: the error of its mean, and its covariance."""

    error: list
    cov: list


def judged(stated, clip, start=((1.0, 0.0), (0.0, 1.0)), third=0.0):
    """Whether `judge` finds a run diverged that starts as stated, then states this, then is sound again."""
    system = nb.System(
        lambda t, x: 0 * x, lambda t, x: x, np.eye(2), nb.Moments(np.zeros(2), np.eye(2)), clip=clip
    )
    layout = Layout(("f",), (0.0, 1.0, 2.0), (2,), ("x1", "x2"), ("", ""), clip or (math.inf,) * 2, {}, 0)
    sound = Stated([0.1, 0.2], [[1.0, 0.0], [0.0, 1.0]])
    rows = [
        [*(-np.array(each.error)), *np.array(each.cov)[np.triu_indices(2)], *[number] * 4]
        for each, number in ((Stated([0.0, 0.0], start), 0.0), (stated, third), (sound, 0.0))
    ]
    components = jnp.array(rows)[:, :, None]
    return judge(system, system, layout, jnp.zeros((3, 2, 1)), components).diverged[:, 0].tolist()


NEAR = [0.1, 0.2]
LOST = [False, True, True]  # for good
FINE = [False] * 3


@pytest.mark.parametrize(
    ("clip", "cov", "expected"),
    [
        ((2.0, 3.0), [[1999.0**2, 0.0], [0.0, 2999.0**2]], FINE),
        ((2.0, 3.0), [[2001.0**2, 0.0], [0.0, 1.0]], LOST),
        ((2.0, 3.0), [[1.0, 0.0], [0.0, 3001.0**2]], LOST),
        ((2.0, 3.0), [[1.0, 1e125], [1e125, 1.0]], LOST),  # no covariance at all
        ((2.0, 3.0), [[math.nan, 0.0], [0.0, 1.0]], LOST),
        ((2.0, 3.0), [[1.0, 0.0], [0.0, math.inf]], LOST),
        ((2.0, 3.0), [[-1.0, 0.0], [0.0, 1.0]], FINE),  # as moment filters may state for a while
        ((2.0, 3.0), [[-1e125, 0.0], [0.0, 1.0]], LOST),
        (None, [[1e20, 0.0], [0.0, 1.0]], FINE),
        (None, [[1e125, 0.0], [0.0, 1.0]], LOST),
        ((2.0, math.inf), [[1.0, 0.0], [0.0, 1e20]], FINE),
        ((2.0, math.inf), [[2001.0**2, 0.0], [0.0, 1e20]], LOST),
    ],
)
def test_what_is_not_finite_or_beyond_all_sense_is_a_divergence_whatever_the_error(clip, cov, expected):
    assert judged(Stated(NEAR, cov), clip) == expected


def test_a_third_moment_beyond_all_sense_is_a_divergence():
    sound = Stated(NEAR, np.eye(2))
    assert judged(sound, (2.0, 2.0), third=1e9) == FINE
    assert judged(sound, (2.0, 2.0), third=1e11) == LOST


def test_a_filter_that_starts_knowing_nothing_has_not_diverged():
    wide = [[1e9, 0.0], [0.0, 1e9]]
    assert judged(Stated(NEAR, [[9e14, 0.0], [0.0, 9e14]]), (1.0, 1.0), start=wide) == FINE
    assert judged(Stated(NEAR, [[2e15, 0.0], [0.0, 1.0]]), (1.0, 1.0), start=wide) == LOST


def test_without_a_clip_and_without_any_size_nothing_is_judged():
    """The start known exactly, the truth at rest there: a filter that believes in noise is right to state it."""
    nothing = [[0.0, 0.0], [0.0, 0.0]]
    assert judged(Stated([0.0, 0.0], [[1.0, 0.0], [0.0, 1.0]]), None, start=nothing) == FINE


def failures(tmp_path, name, filters, **functions):
    """The table of an experiment with a system of one state."""
    system = nb.System(
        **{"drift": lambda t, x: -x, "observe": lambda t, x: x, **functions},
        measurement_cov=[[0.1]],
        initial=nb.Moments([0.0], [[1.0]]),
        interval=0.5,
    )
    plain = {
        "time": {"end": 1.0, "step": 0.1, "output": 0.5},
        "report_times": [1.0],
        "monte_carlo": {"runs": 70, "seed": 3},
        "engine": {"cost": False},
    }
    results = nb.run({"experiment": name, "system": system, "filters": filters, **plain}, tmp_path)
    return results, results.table("failures").to_dict("records")


def root(t, x):
    return jnp.sqrt(jnp.abs(x))


@pytest.mark.parametrize(
    ("functions", "first"),
    [
        ({"observe": root}, (0.5, "update", "the mean and covariance are not finite")),
        ({"drift": root}, (0.5, "propagation", "the covariance is not finite")),
        ({"diverged": lambda e: abs(e[0]) >= 0}, (0.0, "", "its error is beyond the system's bound")),
    ],
    ids=["update", "propagation", "rule"],
)
def test_a_filter_that_failed_says_when_and_in_what_it_first_went_wrong(
    tmp_path, functions, first, monkeypatch
):
    """The derivative of a root is infinite where the filter starts, which would be refused; which of its moments shows
    it, by hand."""
    monkeypatch.setattr(derivatives, "refuse_singular", lambda *_: None)
    results, rows = failures(tmp_path, "kinked", ["ekf"], **functions)
    time, part, what = first
    assert rows == [{"filter": "ekf", "run": 0, "time": time, "part": part, "what": what}]
    page = report.write(results)
    assert f"</strong>: {told(rows[0])}." in unescape(page.read_text())
    facts = summary.facts(results.experiment, results, page)
    (fault,) = summary.faults(results.experiment, facts, gate=False)
    assert str(fault) == f"FAILED: ekf: no run gave a usable estimate; {told(rows[0])}"
    assert facts["failures"] == rows


def test_filters_that_did_not_fail_have_no_such_table(matched):
    assert "failures" not in matched.tables
