"""Claim: runs with continuous measurements draw one at the start of each step, and every filter's update is a step."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import config
from nlbench import simulate as sim
from nlbench.errors import ConfigError
from nlbench.schedule import make
from tests.oracle import kalman_update, rk4

PSD, STEP, END, SEED = 0.16, 0.01, 0.2, 5
SYSTEM = {"name": "culver-scalar", "measurement": "continuous", "measurement_variance": PSD}


def data(system, number=0, step=STEP, end=END):
    """States and measurements of one trajectory of the seed."""
    schedule = make(end, step, 0.1, None, continuous=True)
    words = [0, number, 0, number]
    trajectory = sim.Trajectory(*map(jnp.uint32, words), jnp.int32(0))
    key = sim.seed_key(jnp.uint32(0), jnp.uint32(SEED))
    states, y, *_ = jax.jit(lambda k, n: sim.simulate(system, schedule, k, n))(key, trajectory)
    return np.asarray(states), np.asarray(y), schedule


def run(out, filters, system=SYSTEM, **more):
    return nb.run(
        config.from_dict(
            {
                "experiment": "continuous",
                "system": system,
                "filters": filters,
                "time": {"end": END, "step": STEP, "output": 0.1},
                "report_times": [0.1, 0.2],
                "monte_carlo": {"runs": 3, "seed": SEED},
                "engine": {"cost": False},
                **more,
            }
        ),
        out,
    )


def errors(results, label):
    """Errors at the end, by run."""
    runs = results.table("runs")
    return runs[(runs["filter"] == label) & (runs["time"] == END)].set_index("run")["x"]


def test_a_step_is_a_segment_with_a_measurement_at_its_start():
    schedule = make(2.0, 0.02, 0.1, None, continuous=True)
    assert (schedule.segment_steps, schedule.segments, schedule.output_every) == (1, 100, 5)
    assert (schedule.measurements, schedule.outputs) == (100, 20)
    np.testing.assert_allclose(schedule.measurement_times, 0.02 * np.arange(100))


def test_measurements_are_of_the_states_at_the_starts_of_steps():
    exact = nb.systems.build("culver-scalar", measurement="continuous", measurement_variance=1e-20)
    states, y, _ = data(exact)
    assert y.shape == (20, 1)
    np.testing.assert_allclose(y, states[:-1], atol=1e-8)


@pytest.mark.parametrize("step", [0.01, 0.002])
def test_their_noise_has_the_spectral_density_over_the_step_as_variance(step):
    """2,000 values of each of two trajectories, |z| < 4 for the mean square."""
    system = nb.systems.build("schwartz", measurement_psd=10.0)
    squares = []
    for number in (0, 1):
        states, y, _ = data(system, number, step, 2000 * step)
        squares.append((y[:, 0] - np.arctan(states[:-1, 0])) ** 2)
    squares = np.concatenate(squares) * step / 10.0
    assert abs(squares.mean() - 1.0) < 4 * np.sqrt(2 / squares.size)


def test_a_run_is_the_filter_called_step_by_step(tmp_path):
    entries = ["kushner-4", "ekf", {"name": "schwartz-1", "nominal": 2.0}]
    found = run(tmp_path, entries)
    system = nb.systems.build(**SYSTEM)
    for label, options in (("kushner-4", {}), ("ekf", {}), ("schwartz-1", {"nominal": 2.0})):
        f = nb.filters.build(label, system, step=STEP, **options)
        update = jax.jit(f.update)
        for number in range(3):
            states, y, _ = data(system, number)
            state = f.init(system.initial)
            for k, sample in enumerate(y):
                state, _ = update(state, k * STEP, sample)
            mine = states[-1, 0] - f.moments(state).mean[0]
            np.testing.assert_allclose(errors(found, label)[number], mine, rtol=1e-9)


def test_the_reference_takes_the_samples_by_bayes_rule(tmp_path):
    """Where everything is linear and Gaussian: a Kalman filter in NumPy, updated at the starts of steps."""
    given = {**SYSTEM, "dynamics": "linear", "ensemble": "normal"}
    found = run(tmp_path, ["kushner-2"], given, reference="exact")
    system = nb.systems.build(**given)
    for number in range(3):
        states, y, _ = data(system, number)
        m, p = np.array([2.0]), np.array([[0.16]])
        for sample in y:
            m, p = kalman_update(m, p, np.eye(1), np.array([[PSD / STEP]]), sample - m)
            m, p = m * np.exp(-2 * STEP), p * np.exp(-4 * STEP)
        np.testing.assert_allclose(errors(found, "exact")[number], states[-1, 0] - m[0], atol=1e-7)


def test_the_truth_moves_as_without_measurements():
    states, _, _ = data(nb.systems.build(**SYSTEM))
    slope = lambda t, x: -2 * x + 0.7 * x**2  # noqa: E731
    np.testing.assert_allclose(states[-1], rk4(slope, states[0], 0.0, END, 200), rtol=1e-8)


def test_filters_of_discrete_measurements_are_refused_by_name(tmp_path):
    with pytest.raises(ConfigError, match="third-order"):
        run(tmp_path, ["third-order"])
    with pytest.raises(ConfigError, match="kushner-3"):
        run(tmp_path, ["kushner-3"], {"name": "culver-scalar"})


def test_a_model_with_the_other_kind_of_measurements_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"third-order.*1 measurements.*continuous measurements"):
        run(tmp_path, [{"name": "third-order", "model": {"measurement": "linear"}}])


def test_a_filter_has_the_steps_of_the_run(tmp_path):
    with pytest.raises(ConfigError, match=r"filters\.0\.step.*time\.step"):
        run(tmp_path, [{"name": "kushner-3", "step": 0.005}])


def test_a_filter_of_two_kinds_takes_the_options_of_the_one_that_it_is(tmp_path):
    """The default integrator of `ekf` is Euler's here; where measurements are at times it is Runge-Kutta's."""
    integrators = {"default": {}, "euler": {"solver": "euler"}, "rk4": {"solver": "rk4"}}
    entries = [{"name": "ekf", "integrator": each, "label": label} for label, each in integrators.items()]
    found = run(tmp_path, entries)
    np.testing.assert_array_equal(errors(found, "default"), errors(found, "euler"))
    assert (errors(found, "rk4") != errors(found, "euler")).all()


@pytest.mark.long
def test_filters_may_assume_what_is_not_true(tmp_path):
    """By the system's parameters, or by the entry's model."""
    assumed = {"name": "schwartz", "measurement_psd": 0.1, "assumed_measurement_psd": 0.4}
    found = run(tmp_path / "a", ["schwartz-2"], assumed)
    other = run(
        tmp_path / "b",
        [{"name": "schwartz-2", "model": {"measurement_psd": 0.4}}],
        {"name": "schwartz", "measurement_psd": 0.1},
    )
    right = run(tmp_path / "c", ["schwartz-2"], {"name": "schwartz", "measurement_psd": 0.1})
    np.testing.assert_array_equal(errors(found, "schwartz-2"), errors(other, "schwartz-2"))
    assert (errors(found, "schwartz-2") != errors(right, "schwartz-2")).all()
