"""Claim: culver-scalar is dx/dt = -2x + .7x^2 with its closed-form flow, finite escape and four ensembles."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench.errors import ConfigError
from tests.oracle_culver import CONDITIONED, ENSEMBLES, ESCAPE, MATCHED, NORMAL, drift, escape_time, flow

DRAWS = 200_000


def build(**parameters):
    return nb.systems.build("culver-scalar", **parameters)


def draws(ensemble, count=DRAWS):
    sample = jax.jit(jax.vmap(build(ensemble=ensemble).sample))
    return np.asarray(sample(jax.random.split(jax.random.key(7), count)))[:, 0]


def assert_mean(values, expected):
    """|z| < 4 for the mean of independent values."""
    z = (values.mean() - expected) / (values.std() / np.sqrt(len(values)))
    assert abs(z) < 4, z


def test_drift_and_measurements_are_the_printed_ones():
    x = jnp.array([1.7])
    np.testing.assert_allclose(build().drift(0.0, x), [drift(0.0, 1.7)], rtol=1e-15)
    np.testing.assert_allclose(build(measurement="linear").observe(0.0, x), [1.7])
    np.testing.assert_allclose(
        build(measurement="quadratic").observe(0.0, x), [3 * 1.7 - 0.5 * 1.7**2], rtol=1e-15
    )
    np.testing.assert_allclose(build(dynamics="linear", decay=0.5).drift(0.0, x), [-0.85])
    np.testing.assert_allclose(build(dynamics="linear").drift(0.0, x), [-3.4])
    system = build(measurement_variance=0.3)
    np.testing.assert_array_equal(system.measurement_cov, [[0.3]])
    np.testing.assert_array_equal(system.initial.mean, [2.0])
    np.testing.assert_array_equal(system.initial.cov, [[0.16]])


@pytest.mark.parametrize("x0", [0.5, 1.16, 2.0, 2.8, 2.84])
def test_flow_solves_the_differential_equation(x0):
    times = np.linspace(0, 2, 5)
    solution = solve_ivp(drift, (0, 2), [x0], method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times).y[0]
    np.testing.assert_allclose(flow(times, x0), solution, rtol=1e-9)
    np.testing.assert_allclose(build().exact.flow(times, x0), solution, rtol=1e-9)


def test_linear_flow_is_exponential():
    grid = build(dynamics="linear", decay=0.5).exact
    np.testing.assert_allclose(grid.flow(1.3, 2.0), 2.0 * np.exp(-0.65), rtol=1e-14)


@pytest.mark.parametrize("x0", [2.9, 3.2])
def test_a_state_above_the_unstable_equilibrium_escapes_in_finite_time(x0):
    t = escape_time(x0)
    exact = build(ensemble="normal").exact
    assert 1e3 < float(exact.flow(t - 1e-4, x0)) < np.inf
    assert not np.isfinite(float(exact.flow(t + 1e-4, x0)))
    np.testing.assert_allclose(t, np.log(0.35 / (0.35 - 1 / x0)) / 2, rtol=1e-12)


def test_matched_ensemble_has_the_variance_that_the_filters_assume():
    """The chosen deviation gives .16 to the digits it has; the draws have the law's first four moments."""
    assert MATCHED.var() == pytest.approx(0.16, abs=2e-10)
    x = draws("matched")
    assert np.abs(x - 2).max() <= 0.84
    assert x.max() < ESCAPE
    for power in (1, 2, 3, 4):
        assert_mean((x - 2) ** power, MATCHED.expect(lambda value, k=power: (value - 2) ** k))


def test_conditioned_ensemble_is_the_printed_one_short_of_escape():
    """1.606 % of N(2, .16) are rejected; the mean falls by .016 and the variance by 8.9 %."""
    assert NORMAL.sf(ESCAPE) == pytest.approx(0.01606, abs=5e-6)
    assert CONDITIONED.mean() - 2 == pytest.approx(-0.016, abs=5e-4)
    assert CONDITIONED.var() / 0.16 - 1 == pytest.approx(-0.0891, abs=1e-4)
    x = draws("conditioned")
    assert x.max() < ESCAPE
    assert_mean(x, CONDITIONED.mean())
    assert_mean((x - CONDITIONED.mean()) ** 2, CONDITIONED.var())


def test_normal_ensemble_is_the_printed_one_escapes_included():
    x = draws("normal")
    assert_mean(x, 2.0)
    assert_mean((x - 2) ** 2, 0.16)
    assert_mean((x > ESCAPE).astype(float), NORMAL.sf(ESCAPE))


@pytest.mark.parametrize("size", [20, 80])
def test_thesis_sets_have_exactly_the_mean_and_variance_wanted(size):
    sets = build(ensemble="thesis-sets", set_size=size).sample
    assert sets.size == size
    for seed in range(3):
        x = np.asarray(sets.transform(jax.random.normal(jax.random.key(seed), (size, 1))))
        assert x.shape == (size, 1)
        assert x.mean() == pytest.approx(2.0, abs=1e-14)
        assert ((x - 2.0) ** 2).mean() == pytest.approx(0.16, abs=1e-14)


def test_a_fixed_initial_error_is_drawn_the_same_every_time():
    sample = build(initial_error={"sigma": -1.5}).sample
    np.testing.assert_allclose(sample(jax.random.key(0)), [2 - 1.5 * 0.4])
    np.testing.assert_allclose(sample(jax.random.key(1)), [2 - 1.5 * 0.4])


@pytest.mark.parametrize("ensemble", ENSEMBLES)
def test_grid_of_the_reference_is_the_ensemble(ensemble):
    """Mean and variance of the 320 weighted points are those of the law, to the midpoint rule's error."""
    grid = build(ensemble=ensemble).exact
    points, weights = np.asarray(grid.points), np.asarray(grid.weights)
    law = ENSEMBLES[ensemble]
    assert len(points) == 320
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert (weights * points).sum() == pytest.approx(law.mean(), abs=1e-5)
    assert (weights * (points - law.mean()) ** 2).sum() == pytest.approx(law.var(), rel=1e-4)


def test_diverged_is_an_error_above_three():
    diverged = build().diverged
    assert [bool(diverged(jnp.array([e]))) for e in (2.9, -2.9, 3.1, -3.1)] == [False, False, True, True]
    assert build().clip == (1.0,)


@pytest.mark.parametrize(
    "bad",
    [
        {"ensemble": "matchd"},
        {"measurement_variance": 0.0},
        {"interval": -1},
        {"decay": -1.0},
        {"intervall": 0.1},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)


def test_all_problems_are_reported_at_once():
    with pytest.raises(ConfigError) as error:
        build(ensemble="matchd", measurement_variance=-1, foo=1)
    for word in ("ensemble", "measurement_variance", "foo"):
        assert word in str(error.value)
