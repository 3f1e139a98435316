"""Claims: the table's NIS and likelihood are those of a plain loop; what was limited or guarded is not counted."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.engine.block import block_tracks, make_chunk, words
from nlbench.engine.problem import make
from nlbench.engine.scores import Score, added, nothing, score
from nlbench.filters.filter import UpdateInfo
from nlbench.simulate import Trajectory, seed_key, simulate
from tests.engine.test_sightings import END, SEED, STEP, stated, turning
from tests.small_runs import experiment

LIMITED = {"name": "third-order", "limiter": 1.0, "label": "limited"}
OSCILLATOR = {
    "system": {"name": "oscillator", "interval": 0.1, "measurement_variance": 2.0},
    "filters": ["linearised-kalman", "third-order-guarded", LIMITED],
    "reference": None,
    "time": {"end": 1.2, "step": 0.05, "output": 0.4},
    "report_times": [1.2],
    "monte_carlo": {"runs": 64, "seed": 5},
    "engine": {"cost": False},
}


def followed(problem, seed):
    """The scores of the first block."""
    lanes = jax.tree.map(lambda part: part[0], make_chunk(problem, 0, 1, 1, problem.block).lanes)
    return jax.jit(lambda lanes: block_tracks(problem, words(seed), lanes, 0)[0])(lanes)


@pytest.mark.parametrize(
    ("z", "S", "guarded", "left_out", "invalid"),
    [
        ([0.5, 1.0], np.eye(2), False, 0, 0),
        ([0.5, 3.0], np.eye(2), False, 1, 0),  # beyond the limiter's two deviations
        ([0.5, 1.0], np.eye(2), True, 1, 0),
        ([0.5, np.nan], np.eye(2), False, 0, 1),
        ([0.5, 1.0], np.full((2, 2), np.nan), False, 0, 1),
        ([0.5, 1.0], np.diag([1.0, -1.0]), False, 0, 1),
        ([0.5, 1.0], np.diag([np.inf, np.inf]), False, 0, 1),
        ([0.5, 1e65], np.eye(2), False, 0, 1),
        ([0.0, 0.0], np.eye(2), False, 0, 0),  # nothing measured
    ],
)
def test_what_is_left_out_has_its_reason(z, S, guarded, left_out, invalid):
    """Limited or guarded is not said of what is not a number, not positive definite, or beyond all sense."""
    f = nb.filters.build("ekf", nb.systems.build("oscillator"), limiter=2.0)
    info = UpdateInfo(*map(jnp.array, (z, S, -1.0, 0.0, guarded)))
    total = added(nothing(1), Score(*(jnp.stack([each]) for each in score(f, info))))
    assert (total.left_out[0], total.invalid[0]) == (left_out, invalid)
    assert total.samples[0] == (left_out + invalid == 0 and any(z))
    assert np.isfinite(total.nis[0])
    assert np.isfinite(total.log_likelihood[0]) != (z[1] == 1e65)


def simulated(problem, seed):
    """A function of a trajectory's number: its states and measurements."""
    run = jax.jit(partial(simulate, problem.truth, problem.schedule, seed_key(*words(seed))))
    return lambda number: run(Trajectory(*words(number), *words(number), np.int32(0)))


def by_hand(f, initial, interval, limiter=None):
    """Of a trajectory's y: (NIS or None, log-likelihood) of each update, from the public interface and NumPy."""
    predict = jax.jit(lambda state, t: f.predict(state, t, t + interval))
    update = jax.jit(f.update)

    def follow(y):
        state, found = f.init(initial), []
        for k in range(len(y)):
            state, info = update(predict(state, k * interval), (k + 1) * interval, y[k])
            z, S = np.asarray(info.innovation), np.asarray(info.innovation_cov)
            clipped = limiter is not None and (np.abs(z) > limiter * np.sqrt(np.diagonal(S))).any()
            fit = not clipped and not info.guarded and (np.linalg.eigvalsh(S) > 0).all()
            found.append((z @ np.linalg.solve(S, z) if fit else None, float(info.log_likelihood)))
        return found

    return follow


def test_scores_are_those_of_a_plain_loop():
    problem = make(experiment(**OSCILLATOR))
    scores = followed(problem, 5).scores
    data, some_left_out = simulated(problem, 5), set()
    for place, runner in enumerate(problem.runners):
        follow = by_hand(runner.filter, runner.initial, 0.1, 1.0 if runner.label == "limited" else None)
        for number in range(0, 64, 9):
            expected = follow(np.asarray(data(number).measurements))
            for output in range(1, 4):
                part = [nis for nis, _ in expected[4 * (output - 1) : 4 * output]]
                counted = [nis for nis in part if nis is not None]
                at = place, output, number
                assert (scores.samples[at], scores.left_out[at]) == (len(counted), 4 - len(counted))
                np.testing.assert_allclose(scores.nis[at], sum(counted), rtol=1e-8, atol=1e-10)
                so_far = sum(gained for _, gained in expected[: 4 * output])
                np.testing.assert_allclose(scores.log_likelihood[at], so_far, rtol=1e-9)
                some_left_out |= {runner.label} if len(counted) < 4 else set()
    assert some_left_out == {"third-order-guarded", "limited"}


@pytest.mark.long
def test_asking_for_scores_changes_no_estimate():
    problem = make(experiment(**OSCILLATOR))
    without = problem._replace(layout=problem.layout._replace(scores=False))
    one, other = (followed(each, 5) for each in (problem, without))
    assert other.scores is None
    np.testing.assert_allclose(one.error, other.error, rtol=1e-7, atol=1e-9)
    np.testing.assert_array_equal(one.guarded, other.guarded)


def test_a_kalman_filter_that_is_right_foretells_its_measurements(tmp_path):
    """Linear and Gaussian: n NIS is chi-square with n m degrees of freedom; the likelihood has a known mean."""
    results = nb.run(
        experiment(
            system={
                "name": "culver-scalar",
                "ensemble": "normal",
                "dynamics": "linear",
                "measurement_variance": 0.1,
            },
            filters=[
                "linearised-kalman",
                {"name": "linearised-kalman", "label": "sure", "initial": {"variance": 0.05}},
            ],
            reference=None,
            monte_carlo={"runs": 4000, "seed": 3},
        ),
        tmp_path,
    )
    table = results.table("statistics").set_index(["filter", "time", "statistic"])
    for time in ("0.1", "0.2", "0.6", "all"):
        row = table.loc["linearised-kalman", time, "nis"]
        assert abs(row.value - 1.0) < 4 * np.sqrt(2 / row.n)
        assert row.n == (6 * 4000 if time == "all" else 4000)
        assert row.stderr == pytest.approx(np.sqrt(2 / row.n), rel=0.4)
    assert table.loc["sure", "0.1", "nis"].value > 1.2
    likelihoods = [table.loc[label, "0.6", "log_likelihood"] for label in ("linearised-kalman", "sure")]
    assert likelihoods[0].value - likelihoods[1].value > 4 * likelihoods[1].stderr


def test_sightings_are_scored_as_each_lane_makes_them():
    system = turning(step=STEP)
    problem = make(experiment(**{**stated(system), "system": {"name": "own"}, "reference": None}), system)
    tracks = followed(problem, SEED)
    np.testing.assert_array_equal(tracks.scores.samples.sum(1), tracks.updates)
    number = 11
    run = simulated(problem, SEED)(number)
    states, noise = np.asarray(run.states), np.asarray(run.noise)
    f = problem.runners[1].filter
    predict = jax.jit(lambda state, t: f.predict(state, t, t + STEP))
    update = jax.jit(lambda state, t, y, number: f.update(state, t, y, sighting=number))
    state, made, angle, nis, likelihood = f.init(system.initial), 0, 0.0, [], 0.0
    for step in range(1, round(END / STEP) + 1):
        state, x = predict(state, (step - 1) * STEP), states[step]
        angle += np.remainder(float(f.angle(state)) - angle + np.pi, 2 * np.pi) - np.pi
        turn, place = divmod(made, 3)
        if angle >= system.sightings.angles[place] + 2 * np.pi * turn:
            y = x[0] * x[1] + system.sightings.marks[place] * x[0] + noise[made]
            state, info = update(state, step * STEP, y, made)
            made += 1
            nis.append((step * STEP, float(info.innovation[0] ** 2 / info.innovation_cov[0, 0])))
            likelihood += float(info.log_likelihood)
    assert made >= 5
    for output in range(1, round(END) + 1):
        expected = sum(value for t, value in nis if output - 1 < t - 1e-9 <= output)
        np.testing.assert_allclose(tracks.scores.nis[1, output, number], expected, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(tracks.scores.log_likelihood[1, -1, number], likelihood, rtol=1e-8)


def test_continuous_measurements_are_scored_step_by_step(tmp_path):
    """dx = -x dt, y = x + white noise of spectral density Gamma: NIS of nu with the variance Gamma/dt."""
    results = nb.run(
        {
            "experiment": "continuous",
            "system": nb.System(
                drift=lambda t, x: -x,
                observe=lambda t, x: x,
                measurement_cov=[[0.1]],
                initial=nb.Moments([1.0], [[0.5]]),
                measurement="continuous",
            ),
            "filters": ["kushner-2"],
            "time": {"end": 1.0, "step": 0.01, "output": 0.5},
            "monte_carlo": {"runs": 1000, "seed": 4},
            "engine": {"cost": False},
        },
        tmp_path,
    )
    table = results.table("statistics").set_index(["time", "statistic"])
    for time in ("0.5", "1.0"):
        row = table.loc[time, "nis"]
        assert row.n == 50 * 1000
        # The error of x itself adds P dt / Gamma, which is up to 5 %, to the variance of the noise.
        assert 1.0 - 4 * np.sqrt(2 / row.n) < row.value < 1.06


def test_nothing_measured_is_not_scored(tmp_path):
    system = {"name": "culver-scalar", "measurement": "none"}
    results = nb.run(experiment(system=system, filters=["second-order"], reference=None), tmp_path)
    assert not set(results.table("statistics").statistic) & {"nis", "log_likelihood"}


def test_scores_that_nobody_asks_for_are_not_made(tmp_path):
    results = nb.run(experiment(scores=False, filters=["second-order"], reference=None), tmp_path)
    assert not set(results.table("statistics").statistic) & {"nis", "log_likelihood"}
    assert np.isfinite(results.table("statistics").value).all()
