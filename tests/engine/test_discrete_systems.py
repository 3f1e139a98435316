"""Claim: a system in discrete time runs like one in continuous time, with the numbers of its steps for times."""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import config, engine
from nlbench.engine.block import chunk_sums, make_chunk, words
from nlbench.engine.problem import make
from nlbench.errors import ConfigError
from nlbench.filters import catalogue
from tests.small_runs import table_bytes

TURNS = np.array([[[1.0, 0.5], [-0.2, 0.9]], [[0.8, 0.1], [0.0, 1.1]], [[0.5, 0.0], [0.3, 0.3]]])
SEEN = np.array([[[1.0, 0.0]], [[0.0, 2.0]]])
Q = np.array([[0.3, 0.15], [0.15, 0.075]])  # singular
R = np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.0, 0.0, 0.2]])  # singular
MIXED = np.array([[1.0, 0.5, 1.0]])  # three noises make one measurement
P0 = np.array([[1.0, 0.2], [0.2, 0.5]])
INTERVAL = 3
OWN = {"name": "own", "time": "discrete", "interval": INTERVAL}


def linear(**changes):
    """Looks its matrices up by the number of the step, which must therefore be an integer."""
    turns, seen = jnp.asarray(TURNS), jnp.asarray(SEEN)
    given = {
        "transition": lambda k, x, w: turns[k % 3] @ x + w,
        "observe": lambda k, x, v: seen[k // INTERVAL % 2] @ x + MIXED @ v,
        "process_cov": Q,
        "measurement_cov": R,
        "initial": nb.Moments(mean=np.array([1.0, -1.0]), cov=P0),
        "interval": INTERVAL,
        **changes,
    }
    return nb.DiscreteSystem(**given)


def scalar(**changes):
    given = {
        "transition": lambda k, x, w: 0.9 * x + w,
        "observe": lambda k, x, v: x + v,
        "process_cov": np.array([[0.5]]),
        "measurement_cov": np.array([[0.4]]),
        "initial": nb.Moments(mean=np.zeros(1), cov=np.eye(1)),
        **changes,
    }
    return nb.DiscreteSystem(**given)


def stated(system, **changes):
    plain = {
        "experiment": "steps",
        "filters": ["ekf"],
        "time": {"end": 12, "output": 2},
        "monte_carlo": {"runs": 200, "seed": 3},
        "engine": {"cost": False},
    }
    return {**plain, **changes, "system": system}


def run(system, out, **changes):
    return nb.run(stated(system, **changes), out)


def statistic(results, label, name, coordinate):
    """value and stderr of a statistic by time."""
    table = results.table("statistics")
    table = table[(table["filter"] == label) & (table.statistic == name) & (table.coordinate == coordinate)]
    table = table[table.time != "all"]
    return table.assign(time=table.time.astype(float)).set_index("time")


def riccati(steps):
    """Covariances of the Kalman filter after each step, the start first."""
    P, D = P0, MIXED @ R @ MIXED.T
    found = [P]
    for k in range(steps):
        P = TURNS[k % 3] @ P @ TURNS[k % 3].T + Q
        if (k + 1) % INTERVAL == 0:
            H = SEEN[(k + 1) // INTERVAL % 2]
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + D)
            P = P - K @ H @ P
        found.append(P)
    return np.array(found)


@pytest.fixture(scope="module")
def linear_results(tmp_path_factory):
    return run(
        linear(),
        tmp_path_factory.mktemp("linear"),
        filters=["kalman", "ekf", "ukf"],
        time={"end": 30, "output": 6},  # three steps to a segment
        monte_carlo={"runs": 2000, "seed": 3},
    )


@pytest.mark.parametrize("name", ["kalman", "ekf", "ukf"])
def test_the_variance_of_a_linear_system_is_that_of_the_riccati_recursion(linear_results, name):
    expected = riccati(30)[::6]
    for i, coordinate in enumerate(("x1", "x2")):
        estimated = statistic(linear_results, name, "variance_estimated", coordinate)
        actual = statistic(linear_results, name, "variance_actual", coordinate)
        assert list(estimated.index) == [0, 6, 12, 18, 24, 30]
        np.testing.assert_allclose(estimated.value, expected[:, i, i], rtol=1e-10)
        assert (abs(actual.value - expected[:, i, i]) < 4 * actual.stderr).all()


def test_errors_of_a_linear_system_have_mean_zero(linear_results):
    for coordinate in ("x1", "x2"):
        mean = statistic(linear_results, "kalman", "mean_error", coordinate)
        assert (abs(mean.value) < 4 * mean.stderr).all()


@pytest.mark.parametrize(
    "name",
    [name for name in catalogue.available() if (True, False) in catalogue.takes(name) and name != "exact"],
)
def test_every_filter_for_discrete_time_is_told_integers(name):
    """`linear` looks its matrices up by k, which a float cannot: that a run can be traced is enough."""
    problem = make(config.from_dict({**stated({}, filters=[name]), "system": OWN}), linear())
    chunk = make_chunk(problem, 0, 1, 1, problem.block)
    sums, _ = jax.eval_shape(partial(chunk_sums, problem), words(0), chunk)
    assert sums


def test_truth_and_measurements_are_taken_at_the_right_steps():
    """Without noise: x(k) is the sum of the first k increments, and a measurement says x and which step it is of."""
    steps = jnp.arange(100.0) ** 2
    marked = scalar(
        transition=lambda k, x, w: x + steps[k] + w,
        observe=lambda k, x, v: jnp.stack([x[0], 1000.0 * k]) + v,
        process_cov=np.zeros((1, 1)),
        measurement_cov=np.zeros((2, 2)),
        initial=nb.Moments(mean=np.array([2.0]), cov=np.zeros((1, 1))),
        interval=4,
    )
    one = engine.replay(stated(marked, filters=["no-filter"], monte_carlo={"runs": 1}), "no-filter", 0)
    assert list(one.time) == [0, 2, 4, 6, 8, 10, 12]
    np.testing.assert_allclose(one.x_truth, [2 + np.sum(np.arange(k) ** 2) for k in range(0, 13, 2)])
    measured = one.time.isin([4, 8, 12])
    np.testing.assert_array_equal(one.y1[measured], one.x_truth[measured])
    np.testing.assert_array_equal(one.y2[measured], 1000 * one.time[measured])
    assert one.y1[~measured].isna().all()


def test_known_inputs_move_truth_and_filters(tmp_path):
    """Pushed alike, the errors are those of the system at rest, to rounding."""
    push = jnp.array([1.0, -3.0, 5.0])
    pushed = scalar(transition=lambda k, x, w, u: 0.9 * x + w + u, inputs=lambda k: push[k % 3])
    rms = [
        statistic(run(system, tmp_path, experiment=name), "ekf", "rms", "x").value
        for name, system in (("pushed", pushed), ("rest", scalar()))
    ]
    np.testing.assert_allclose(*rms, rtol=1e-12)


def test_the_truth_may_have_more_noise_than_a_filter_believes(tmp_path):
    """Errors of a filter with the wrong gain K follow e+ = (1 - K) (a e + w) - K v."""
    a, q, r, wrong = 0.9, 0.5, 0.4, 0.05
    truth = scalar(
        transition=lambda k, x, w: a * x + w[:1] + w[1:], process_cov=np.diag([q / 2, q / 2])
    )  # of two noises
    believed = scalar(process_cov=np.array([[wrong]]), truth=truth)
    results = run(believed, tmp_path, filters=["kalman"], monte_carlo={"runs": 4000})
    P, actual, expected = 1.0, 1.0, {0: (1.0, 1.0)}
    for k in range(1, 13):
        P, actual = a**2 * P + wrong, a**2 * actual + q
        K = P / (P + r)
        P, actual = (1 - K) * P, (1 - K) ** 2 * actual + K**2 * r
        expected[k] = (P, actual)
    found = statistic(results, "kalman", "variance_actual", "x")
    stated_variance = statistic(results, "kalman", "variance_estimated", "x").value
    for k in found.index:
        assert abs(found.value[k] - expected[k][1]) < 4 * found.stderr[k]
        assert stated_variance[k] == pytest.approx(expected[k][0], rel=1e-10)


def test_noise_that_multiplies_the_state_reaches_truth_and_filters(tmp_path):
    """x+ = x (1 + w), y = x (1 + v): E x = 2 and E x^2 = (4 + p) (1 + q)^k, which the EKF follows exactly unmeasured;
    measured, its first gain is c/s with c = E x^2 - 4, s = c + 4 r, linearised at the mean."""
    q, r, p = 0.02, 0.1, 0.3
    grown = scalar(
        transition=lambda k, x, w: x * (1 + w),
        observe=lambda k, x, v: x * (1 + v),
        process_cov=np.array([[q]]),
        measurement_cov=np.array([[r]]),
        initial=nb.Moments(mean=np.array([2.0]), cov=np.array([[p]])),
        interval=None,
    )
    results = run(grown, tmp_path, filters=["no-filter"], monte_carlo={"runs": 8000})
    spread = statistic(results, "no-filter", "variance_actual", "x")
    for k in spread.index:
        assert abs(spread.value[k] - ((4 + p) * (1 + q) ** k - 4)) < 4 * spread.stderr[k]
    once = scalar(**{**vars(grown), "interval": 1})
    results = run(once, tmp_path, time={"end": 1, "output": 1}, filters=["ekf"], monte_carlo={"runs": 4000})
    c = p + 4 * q
    K = c / (c + 4 * r)
    C = (4 + p) * (1 + q) - 4  # the true variance, of which the linearised filter leaves out p q
    expected = (1 - K) ** 2 * C + K**2 * r * (C + 4)
    actual = statistic(results, "ekf", "variance_actual", "x")
    assert abs(actual.value[1] - expected) < 4 * actual.stderr[1]
    assert statistic(results, "ekf", "variance_estimated", "x").value[1] == pytest.approx(
        (1 - K) * c, rel=1e-10
    )


@pytest.mark.parametrize("name", [pytest.param("ensemble", marks=pytest.mark.long), "bootstrap"])
def test_a_filter_of_samples_draws_its_own_in_every_trajectory(name, tmp_path):
    """Against the Kalman filter on the same data: with common draws the differences would be nearly equal."""
    results = run(scalar(), tmp_path, filters=[{"name": name, "particles": 50}, "kalman"])
    kept = results.table("runs").set_index(["filter", "run"]).x
    apart = (kept[name] - kept["kalman"]).to_numpy()
    spread, count = apart.std(), len(apart)
    assert spread > 0.01
    assert abs(apart.mean()) < 4 * spread / np.sqrt(count) + 0.2 * spread
    assert abs(np.corrcoef(apart[:-1], apart[1:])[0, 1]) < 4 / np.sqrt(count)


@pytest.mark.long
def test_chunk_and_threads_do_not_change_one_byte(tmp_path):
    given = {"filters": ["ekf", {"name": "bootstrap", "particles": 20}], "monte_carlo": {"runs": 100}}
    plain, other = (
        run(linear(), tmp_path / str(place), engine=how, **given)
        for place, how in enumerate(({"block": 8}, {"block": 8, "chunk": 3, "threads": 3}))
    )
    assert table_bytes(plain.path) == table_bytes(other.path)


@pytest.mark.long
def test_topping_up_equals_a_straight_run(tmp_path):
    straight = run(linear(), tmp_path / "straight", monte_carlo={"runs": 100})
    for runs in (70, 100):
        topped = run(linear(), tmp_path / "topped", monte_carlo={"runs": runs})
    assert table_bytes(straight.path) == table_bytes(topped.path)


@pytest.mark.long
def test_another_system_gets_another_folder(tmp_path):
    first, again, other = (
        run(system, tmp_path, monte_carlo={"runs": 8}, engine={"block": 8}).path
        for system in (linear(), linear(), linear(process_cov=2 * Q))
    )
    assert first == again != other


def test_rules_of_divergence_coordinates_and_norms_are_those_of_the_system(tmp_path):
    """Errors are those of twice the state; |error| > 2 diverges, and stays so from one report time to the next."""
    judged = scalar(
        coordinates=(nb.Coordinate("double", "m"),),
        error=lambda x, m: 2 * (x - m),
        diverged=lambda error: abs(error[0]) > 2.0,
        diverged_stays=True,
        norms={"size": (0,)},
    )
    results = run(judged, tmp_path, filters=["kalman"], report_times=[4, 8, 12])
    plain = run(scalar(), tmp_path, filters=["kalman"], report_times=[4, 8, 12])
    double = results.table("runs").set_index(["run", "time"]).double
    single = plain.table("runs").set_index(["run", "time"]).x
    np.testing.assert_allclose(double, 2 * single, rtol=1e-10)
    ever = (abs(double.unstack()) > 2.0).any(axis=1).sum()
    assert ever > (abs(double.unstack().iloc[:, -1]) > 2.0).sum()
    assert results.table("divergence").diverged.item() == ever
    assert "size" in set(results.table("statistics").coordinate)


def test_plan_counts_steps_and_measurements():
    planned = engine.plan(stated(linear(), time={"end": 30, "output": 10}))
    assert (planned["steps_per_run"], planned["measurements_per_run"]) == (30, 10)


def test_traces_and_costs_are_saved(tmp_path):
    results = run(linear(), tmp_path, filters=["ekf", "ukf"], traces=[7], engine={"cost": True})
    traced, cost = results.table("traces"), results.table("cost")
    single = engine.replay(stated(linear(), filters=["ekf", "ukf"]), "ukf", 7)
    mine = traced[(traced["filter"] == "ukf") & (traced.coordinate == "x2")]
    np.testing.assert_array_equal(mine.time, single.time)
    np.testing.assert_allclose(mine.error, single.x2_error, rtol=1e-12)
    assert (cost.operations_per_step > 0).all()


def test_a_file_names_its_system_and_counts_steps(tmp_path):
    file = tmp_path / "growth.yaml"
    file.write_text(
        "# Does the square hide the sign?\nexperiment: growth\nsystem: ungm\n"
        "filters: [ekf, {name: bootstrap, particles: 200}]\ntime: {end: 20, output: 10}\nmonte_carlo: {runs: 300}\n"
    )
    results = nb.run(file, tmp_path)
    rms = [statistic(results, name, "rms", "x").value[20] for name in ("bootstrap", "ekf")]
    assert rms[0] < rms[1]
    assert results.experiment.time.step == 1


def test_everything_that_does_not_fit_is_said_at_once(tmp_path):
    bent = scalar(transition=lambda k, x, w: jnp.sin(x) + w)
    with pytest.raises(ConfigError) as caught:
        run(
            bent,
            tmp_path,
            filters=["kalman", {"name": "ekf", "initial": {"mean": [1, 2]}}],
            reference="exact",
        )
    text = str(caught.value)
    for part in ("kalman: transition is not linear", "filters.1.initial.mean: got", "exact: "):
        assert part in text
    assert len(caught.value.problems) == 3


def test_a_filter_that_integrates_is_refused_with_the_other_mistakes(tmp_path):
    with pytest.raises(ConfigError) as caught:
        run(
            scalar(),
            tmp_path,
            filters=["third-order", {"name": "ukf", "step": 0.5}, {"name": "ekf", "equations": "printed"}],
            time={"end": 10.5, "output": 1, "step": 0.5},
        )
    assert {each.path for each in caught.value.problems} == {
        "filters.0.name", "filters.1.step", "filters.2.equations", "time.end", "time.step",
    }  # fmt: skip


def test_a_shape_that_does_not_fit_is_told_once(tmp_path):
    with pytest.raises(ConfigError, match="process_cov") as caught:
        run(scalar(process_cov=np.zeros(3)), tmp_path, filters=["ekf", "ukf"])
    assert len(caught.value.problems) == 1


def test_a_truth_of_other_size_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"1 states .* 2 states"):
        run(scalar(truth=linear()), tmp_path)


def test_a_reference_of_particles_is_called_what_it_is_and_nears_the_exact_posterior(tmp_path):
    """Of a linear system; a mean of 10,000 resampled particles is off by some .015 of the deviation, and so the
    RMS error of 64 runs by 4 x .015 / sqrt(64) of itself at most."""
    results = run(scalar(), tmp_path, reference="particles", monte_carlo={"runs": 64, "seed": 3})
    kalman, particles = (statistic(results, label, "rms", "x") for label in ("ekf", "particles 10,000"))
    np.testing.assert_allclose(particles.value, kalman.value, rtol=7.5e-3)
    assert not np.array_equal(particles.value, kalman.value)
