"""Claims: the tables are what a plain loop over the same trajectories finds; overrides reach data and filters."""

from __future__ import annotations

import math

import jax
import numpy as np
import pytest

import nlbench as nb
from nlbench.engine.block import words
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.simulate import Trajectory, seed_key, simulate
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
