"""Claim: ungm is the growth model as printed, with the published start, and its signal stays within thirty."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.discrete.problems import simulated


def build(**parameters):
    return nb.systems.build("ungm", **parameters)


@pytest.mark.parametrize("x", [-14.0, -0.3, 0.0, 2.0, 19.0])
@pytest.mark.parametrize("k", [0, 1, 7, 499])
def test_transition_and_measurement_are_the_printed_ones(k, x):
    system = build()
    ahead = 0.5 * x + 25 * x / (1 + x * x) + 8 * np.cos(1.2 * k) - 0.7
    np.testing.assert_allclose(
        system.transition(k, jnp.array([x]), jnp.array([-0.7])), [ahead], rtol=1e-14, atol=1e-14
    )
    np.testing.assert_allclose(
        system.observe(k, jnp.array([x]), jnp.array([0.2])), [x * x / 20 + 0.2], rtol=1e-14
    )


def test_published_values_are_the_defaults():
    """Truth from .1 exactly; filters from .1 with variance 1; noises of variance 1; measured at every step."""
    system = build()
    np.testing.assert_array_equal(system.sample(jax.random.key(3)), [0.1])
    np.testing.assert_array_equal(system.initial.mean, [0.1])
    np.testing.assert_array_equal(system.initial.cov, [[1.0]])
    np.testing.assert_array_equal(system.process_cov, [[1.0]])
    np.testing.assert_array_equal(system.measurement_cov, [[1.0]])
    assert (system.interval, system.truth, system.states, system.measurements) == (1, None, 1, 1)
    assert (system.clip, [coordinate.name for coordinate in system.coordinates]) == ((20.0,), ["x"])
    assert system.exact == ((-40.0,), (40.0,), (1201,))


def test_parameters_reach_the_system():
    system = build(process_variance=2.0, measurement_variance=3.0, initial_variance=4.0, interval=5)
    found = (system.process_cov, system.measurement_cov, system.initial.cov)
    assert [np.asarray(cov).item() for cov in found] == [2.0, 3.0, 4.0]
    assert system.interval == 5


def test_the_signal_changes_sign_often_and_stays_within_thirty():
    """Of 20 runs of 500 steps: both signs are visited all the time, and a grid on [-40, 40] holds the density."""
    system = build()
    x, _ = jax.jit(jax.vmap(lambda key: simulated(system, key, 500)))(jax.random.split(jax.random.key(1), 20))
    x = np.asarray(x)[..., 0]
    assert np.abs(x).max() < 30
    assert 0.3 < (x > 0).mean() < 0.7
    assert ((x[:, 1:] > 0) != (x[:, :-1] > 0)).sum(1).min() > 30


def test_diverged_is_an_error_above_ten_thousand():
    diverged = build().diverged
    assert [bool(diverged(jnp.array([e]))) for e in (9999.0, -9999.0, 10001.0, -10001.0)] == [
        False,
        False,
        True,
        True,
    ]


@pytest.mark.parametrize(
    "bad",
    [
        {"process_variance": 0.0},
        {"measurement_variance": -1.0},
        {"initial_variance": float("nan")},
        {"interval": 0},
        {"interval": 0.5},
        {"steps": 500},
    ],
)
def test_parameters_out_of_range_or_unknown_are_refused(bad):
    with pytest.raises(ConfigError, match=next(iter(bad))):
        build(**bad)
