"""Claim: no-filter answers the initial mean and covariance to the last bit, in every kind of system, whatever is
measured, and says of a measurement what they foretell."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import config
from nlbench.errors import ConfigError

MEAN, COV = np.array([1.0, -0.5]), np.array([[0.5, 0.1], [0.1, 0.3]])
START = nb.Moments(MEAN, COV)
H, D, R = np.array([[1.0, 0.4]]), np.array([[2.0]]), np.array([[0.2]])
STEP = 0.05


def in_continuous_time(**changed):
    given = {
        "drift": lambda t, x: -x * x,
        "observe": lambda t, x: jnp.asarray(H) @ x,
        "measurement_cov": R,
        "initial": START,
        "step": STEP,
    }
    return nb.System(**(given | changed))


def in_discrete_time():
    return nb.DiscreteSystem(
        transition=lambda k, x, w: -x + w,
        observe=lambda k, x, v: jnp.asarray(H) @ x + jnp.asarray(D) @ v,
        process_cov=0.1 * np.eye(2),
        measurement_cov=R,
        initial=START,
    )


# The covariance that a measurement then has: H P H' + the noise's.
SEEN = (H @ COV @ H.T)[0, 0]
SYSTEMS = {
    "measured at times": (in_continuous_time(), SEEN + 0.2),
    "measured continuously": (in_continuous_time(measurement="continuous"), SEEN + 0.2 / STEP),
    "discrete time": (in_discrete_time(), SEEN + 4 * 0.2),
}
EVERY = pytest.mark.parametrize(("system", "variance"), SYSTEMS.values(), ids=SYSTEMS)


@EVERY
def test_estimate_and_covariance_stay_whatever_is_measured(system, variance):
    f = nb.filters.build("no-filter", system)
    state = f.init(START)
    for k, y in enumerate((0.3, -50.0, np.nan)):
        state, _ = f.update(f.integrate(f.predict(state, k, k + 1), k, STEP, 3), k + 1, np.array([y]))
    mean, cov, third, fourth = f.moments(state)
    np.testing.assert_array_equal(mean, MEAN)
    np.testing.assert_array_equal(cov, COV)
    assert (third, fourth) == (None, None)
    for rate in f.rates(state, 0.0, np.array([0.3]))[:2]:
        np.testing.assert_array_equal(rate, 0.0)


@EVERY
def test_a_measurement_is_foretold_by_the_initial_moments(system, variance):
    f = nb.filters.build("no-filter", system)
    _, info = f.update(f.init(START), 1, np.array([0.3]))
    z = 0.3 - (H @ MEAN)[0]
    np.testing.assert_allclose(info.innovation, [z], rtol=1e-13)
    np.testing.assert_allclose(info.innovation_cov, [[variance]], rtol=1e-13)
    expected = -0.5 * (z * z / variance + np.log(2 * np.pi * variance))
    np.testing.assert_allclose(info.log_likelihood, expected, rtol=1e-13)
    assert not bool(info.guarded)
    _, missing = f.update(f.init(START), 1, np.array([np.nan]))
    assert (float(missing.innovation[0]), float(missing.log_likelihood)) == (0.0, 0.0)


def test_it_starts_from_the_moments_it_is_given():
    f = nb.filters.build("no-filter", in_discrete_time())
    mean, cov, *_ = f.moments(f.init(nb.Moments(MEAN + 1, 2 * COV)))
    np.testing.assert_array_equal(mean, MEAN + 1)
    np.testing.assert_array_equal(cov, 2 * COV)


def test_without_a_step_continuous_measurements_ask_for_one():
    with pytest.raises(ConfigError, match=r"no-filter: .*step"):
        nb.filters.build("no-filter", in_continuous_time(measurement="continuous", step=None))


def test_it_takes_sightings_of_its_own_mark_and_never_turns():
    system = nb.systems.build("lunar-orbit", case="100-mile")
    f = nb.filters.build("no-filter", system)
    state = f.init(system.initial)
    assert system.sightings is not None
    for number in (0, 1):
        y = system.sightings.observe(system.sightings.mark(number), system.initial.mean) + 1e-3
        _, info = f.update(state, 0.0, y, sighting=number)
        np.testing.assert_allclose(info.innovation, 1e-3, rtol=1e-9)
    before, after = (float(f.angle(each)) for each in (state, f.integrate(state, 0.0, 50.0, 10)))
    assert before == after


@pytest.mark.parametrize("measurement", ["linear", "none", "continuous"])
def test_in_a_run_its_error_is_the_state_less_the_initial_mean(measurement, tmp_path):
    """From 2.4 the state is at 2.4 E/(1 - .84 (1 - E)) at .2 s, E = exp(-.4)."""
    results = nb.run(
        config.from_dict(
            {
                "experiment": "unfiltered",
                "system": {
                    "name": "culver-scalar",
                    "measurement": measurement,
                    "initial_error": {"sigma": 1.0},
                },
                "filters": [{"name": "no-filter", "label": "no filter"}],
                "time": {"end": 0.2, "step": 0.02, "output": 0.1},
                "monte_carlo": {"runs": 3, "seed": 4},
                "engine": {"cost": False},
            }
        ),
        tmp_path,
    )
    E = np.exp(-0.4)
    runs = results.table("runs")
    expected = 2.4 * E / (1 - 0.84 * (1 - E)) - 2.0
    np.testing.assert_allclose(runs[runs["time"] == 0.2]["x"], np.full(3, expected), atol=1e-7)
    table = results.table("statistics").set_index(["filter", "statistic", "time", "coordinate"])
    assert table.loc[("no filter", "variance_estimated", "0.2", "x"), "value"] == pytest.approx(0.16)
