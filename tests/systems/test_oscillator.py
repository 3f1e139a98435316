"""Claim: oscillator is Culver's (8.5) with unknown damping ratio, in three ensembles, judged cumulatively."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import norm, truncnorm

import nlbench as nb
from nlbench.algebra import expand
from nlbench.errors import ConfigError
from tests.small_runs import experiment

DRAWS = 200_000
MEAN = np.array([10.0, 0.0, 0.5])
BOUND = 0.84 / 0.5003729518
LAWS = {
    ("matched", 0.16): truncnorm(-BOUND, BOUND, loc=0.5, scale=0.5003729518),
    ("matched", 0.09): truncnorm(-BOUND, BOUND, loc=0.5, scale=0.75 * 0.5003729518),
    ("normal", 0.16): norm(0.5, 0.4),
}
EVERY = pytest.mark.parametrize(("ensemble", "variance"), LAWS)


def build(**parameters):
    return nb.systems.build("oscillator", **parameters)


def slope(t, x):
    """(8.5) with omega = 1 and no process noise."""
    return [x[1], -x[0] - 2 * x[2] * x[1], 0.0]


def assert_mean(values, expected):
    """|z| < 4 for the mean of independent values."""
    z = (values.mean() - expected) / (values.std() / np.sqrt(len(values)))
    assert abs(z) < 4, z


def test_published_values_are_the_defaults():
    system = build()
    np.testing.assert_array_equal(system.initial.mean, MEAN)
    np.testing.assert_array_equal(system.initial.cov, np.diag([9.0, 9.0, 0.16]))
    np.testing.assert_array_equal(system.measurement_cov, 50.0 * np.eye(2))
    assert (system.interval, system.step, system.diffusion) == (0.2, 0.05, None)
    np.testing.assert_array_equal(system.observe(0.0, jnp.array([3.0, -4.0, 0.7])), [3.0, -4.0])
    other = build(damping_variance=0.09, measurement_variance=10.0, interval=1.0)
    np.testing.assert_array_equal(other.initial.cov, np.diag([9.0, 9.0, 0.09]))
    np.testing.assert_array_equal(other.measurement_cov, 10.0 * np.eye(2))
    assert other.interval == 1.0
    assert build(measurement="none").interval is None


def test_coordinates_are_position_velocity_and_damping():
    assert [coordinate.name for coordinate in build().coordinates] == ["position", "velocity", "damping"]
    assert build().clip == (10.0, 10.0, 1.0)


@pytest.mark.parametrize("damping", [-0.3, 0.0, 0.5, 1.0, 1.3])
def test_drift_moves_the_state_as_the_differential_equation_does(damping):
    """The linearised filter's mean without data, in RK4 steps of .05 s, against DOP853: an error of order h^4."""
    start = np.array([10.0, -2.0, damping])
    f = nb.filters.build("linearised-kalman", build())
    state = f.predict(f.init(nb.Moments(start, np.eye(3))), 0.0, 3.0)
    solution = solve_ivp(slope, (0, 3), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(f.moments(state).mean, solution, atol=2e-5 * np.abs(solution).max())


def test_derivatives_have_the_printed_zeros():
    """(8.7): F12 = 1, F21 = -1, F22 = -2 m3, F23 = -2 m2, A223 + A232 = -2, all others structurally zero."""
    m = [jnp.asarray(value) for value in (3.0, -4.0, 0.7)]
    f = expand(build().drift, 0.0, m, 2)
    assert set(f.first.entries) == {(0, 1), (1, 0), (1, 1), (1, 2)}
    assert set(f.second.entries) == {(1, 1, 2)}
    np.testing.assert_allclose(
        f.first.to_array(), [[0.0, 1.0, 0.0], [-1.0, -1.4, 8.0], [0.0, 0.0, 0.0]], atol=1e-15
    )
    assert f.second[1, 1, 2] == -1.0  # half of the second derivative


@EVERY
def test_ensembles_have_the_law_that_they_name(ensemble, variance):
    """First four moments of the damping ratio; position and velocity normal; nothing correlated."""
    system = build(ensemble=ensemble, damping_variance=variance)
    law = LAWS[ensemble, variance]
    x = np.asarray(jax.jit(jax.vmap(system.sample))(jax.random.split(jax.random.key(3), DRAWS)))
    assert law.var() == pytest.approx(variance, rel=2e-9)
    assert law.support()[0] <= x[:, 2].min()
    assert x[:, 2].max() <= law.support()[1]
    for i, each in enumerate((norm(10, 3), norm(0, 3), law)):
        for power in (1, 2, 3, 4):
            assert_mean((x[:, i] - MEAN[i]) ** power, each.expect(lambda v, i=i, k=power: (v - MEAN[i]) ** k))
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert_mean((x[:, i] - MEAN[i]) * (x[:, j] - MEAN[j]), 0.0)


@pytest.mark.parametrize("size", [10, 20])
def test_thesis_sets_have_exactly_the_means_and_variances_wanted(size):
    sets = build(ensemble="thesis-sets", set_size=size, damping_variance=0.09).sample
    assert sets.size == size
    x = np.asarray(sets.transform(jax.random.normal(jax.random.key(1), (size, 3))))
    np.testing.assert_allclose(x.mean(0), MEAN, atol=1e-14)
    np.testing.assert_allclose(((x - MEAN) ** 2).mean(0), [9.0, 9.0, 0.09], rtol=1e-14)


@EVERY
def test_nodes_of_the_reference_are_the_ensemble(ensemble, variance):
    """First four moments of the law; beyond the six standard deviations covered a normal one has 7e-8 of its fourth."""
    bank = build(ensemble=ensemble, damping_variance=variance).exact
    law = LAWS[ensemble, variance]
    assert bank.weights.sum() == pytest.approx(1.0, abs=1e-12)
    for power in (1, 2, 3, 4):
        found = bank.weights @ (bank.nodes - 0.5) ** power
        assert found == pytest.approx(law.expect(lambda v, k=power: (v - 0.5) ** k), abs=1e-7)
    np.testing.assert_allclose(bank.drift[7], [[0.0, 1.0], [-1.0, -2.0 * bank.nodes[7]]])


def test_process_noise_enters_the_velocity():
    system = build(process_variance=10.0)
    x = jnp.asarray(MEAN)
    np.testing.assert_allclose(system.diffusion_spectrum(0.0, x), np.diag([0.0, 10.0, 0.0]))
    np.testing.assert_array_equal(system.exact.spectrum, np.diag([0.0, 10.0]))
    assert build(process_variance=0.0).diffusion is None


def test_diverged_is_an_error_above_three_in_damping_or_a_hundred_in_position():
    diverged = build().diverged
    for error, expected in (
        ((99.0, 1e9, 2.9), False),
        ((-99.0, -1e9, -2.9), False),
        ((101.0, 0.0, 0.0), True),
        ((-101.0, 0.0, 0.0), True),
        ((0.0, 0.0, 3.1), True),
        ((0.0, 0.0, -3.1), True),
    ):
        assert bool(diverged(jnp.array(error))) is expected


def test_a_diverged_run_stays_diverged(tmp_path):
    """Filters begin with an error of 8 in damping that the data soon correct: diverged at once, and ever after."""
    found = nb.run(
        experiment(
            system={"name": "oscillator", "measurement_variance": 1e-4},
            filters=["linearised-kalman"],
            initial={"mean": [10.0, 0.0, 8.5], "cov": [[9.0, 0, 0], [0, 9.0, 0], [0, 0, 64.0]]},
            reference=None,
            time={"end": 4.0, "step": 0.05, "output": 0.2},
            report_times=[0.2, 2.0, 4.0],
            monte_carlo={"runs": 128, "seed": 1},
        ),
        tmp_path,
    )
    table = found.table("statistics").set_index(["statistic", "coordinate", "time"]).value
    fractions = [table["diverged", "all", time] for time in ("0.2", "2.0", "4.0")]
    assert fractions[0] > 0
    assert fractions == sorted(fractions)


@pytest.mark.parametrize(
    "bad",
    [
        {"ensemble": "conditioned"},
        {"damping_variance": 0.0},
        {"measurement_variance": -1.0},
        {"process_variance": -1.0},
        {"measurement": "quadratic"},
        {"omega": 2.0},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
