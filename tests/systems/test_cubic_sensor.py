"""Claim: cubic-sensor is a Wiener process seen through its cube, of which an expansion about zero sees nothing."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError


def build(**parameters):
    return nb.systems.build("cubic-sensor", **parameters)


def test_the_state_is_driven_by_noise_alone_and_seen_through_its_cube():
    system = build()
    for x in (-2.0, 0.0, 0.7):
        np.testing.assert_array_equal(system.drift(0.0, jnp.array([x])), [0.0])
        np.testing.assert_allclose(system.observe(0.0, jnp.array([x])), [x * x * x], rtol=1e-15)
        np.testing.assert_array_equal(system.diffusion_spectrum(0.0, jnp.array([x])), [[1.0]])


def test_defaults_are_of_unit_size():
    system = build()
    assert (system.measurement, system.step, system.interval, system.states) == ("continuous", 0.001, None, 1)
    np.testing.assert_array_equal(system.measurement_cov, [[1.0]])
    np.testing.assert_array_equal(system.initial.mean, [0.0])
    np.testing.assert_array_equal(system.initial.cov, [[1.0]])
    assert (system.clip, system.coordinates[0].name) == ((3.0,), "x")
    assert system.exact == (-10.0, 10.0, 400)


def test_parameters_reach_the_system():
    system = build(process_psd=2.0, measurement_psd=3.0, initial_mean=-1.0, initial_variance=4.0)
    np.testing.assert_array_equal(system.diffusion_spectrum(0.0, jnp.zeros(1)), [[2.0]])
    np.testing.assert_array_equal(system.measurement_cov, [[3.0]])
    np.testing.assert_array_equal(system.initial.mean, [-1.0])
    np.testing.assert_array_equal(system.initial.cov, [[4.0]])


@pytest.mark.parametrize("name", ["ekf", "kushner-2", "kushner-3", "kushner-4", "schwartz-2", "schwartz-8"])
def test_a_filter_that_expands_the_cube_about_zero_learns_nothing(name):
    """Slope and curvature of x^3 are 0 there: its variance grows as if nothing were measured."""
    system = build()
    f = nb.filters.build(name, system)
    state, _ = jax.jit(f.update)(f.init(system.initial), 0.0, jnp.array([5.0]))
    np.testing.assert_allclose(f.moments(state).mean, [0.0], atol=1e-15)
    np.testing.assert_allclose(f.moments(state).cov, [[1.0 + 0.001]], rtol=1e-12)


def test_away_from_zero_filters_move_by_slope_and_second_order_expects_more():
    """At mean 1 and variance 1, y = 5: gain 3; the expected cube is 1, and 1 + 3 with the curvature."""
    system = build(initial_mean=1.0)
    for name, mean in (("ekf", 1 + 3 * (5 - 1) * 0.001), ("kushner-2", 1 + 3 * (5 - 4) * 0.001)):
        f = nb.filters.build(name, system)
        state, _ = jax.jit(f.update)(f.init(system.initial), 0.0, jnp.array([5.0]))
        np.testing.assert_allclose(f.moments(state).mean, [mean], rtol=1e-12)


def test_diverged_is_an_error_above_twenty():
    diverged = build().diverged
    assert [bool(diverged(jnp.array([e]))) for e in (19.9, -19.9, 20.1, -20.1)] == [False, False, True, True]


@pytest.mark.parametrize(
    "bad",
    [
        {"process_psd": 0.0},
        {"measurement_psd": -1.0},
        {"initial_mean": float("nan")},
        {"initial_variance": 0.0},
        {"interval": 0.1},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
