"""Claim: truth in discrete time follows the transition, step by step, with noise of the stated covariances."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench import simulate as sim
from nlbench.errors import ConfigError
from nlbench.schedule import make

RUNS = 20_000
SINGULAR = np.array([[0.5, 0.25, 0.0], [0.25, 0.125, 0.0], [0.0, 0.0, 2.0]])


def noises(interval=2, **changes):
    """State: the process noises of the last step; measurement: the noises themselves."""
    given = {
        "transition": lambda k, x, w: w,
        "observe": lambda k, x, v: v,
        "process_cov": SINGULAR,
        "measurement_cov": SINGULAR[:2, :2],
        "initial": nb.Moments(mean=np.zeros(3), cov=np.eye(3)),
        "interval": interval,
        **changes,
    }
    return nb.DiscreteSystem(**given)


def simulated(system, count, end, output, seed=5):
    """States (count, segments + 1, n) and measurements (count, M, m)."""
    schedule = make(end, 1, output, system.interval)
    low, zero = jnp.arange(count, dtype=jnp.uint32), jnp.zeros(count, jnp.uint32)
    lanes = sim.Trajectory(zero, low, zero, low, zero)
    key = sim.seed_key(jnp.uint32(0), jnp.uint32(seed))
    states, y, *_ = jax.jit(jax.vmap(lambda lane: sim.simulate(system, schedule, key, lane)))(lanes)
    return np.asarray(states), np.asarray(y)


def test_all_times_of_the_schedule_are_integers():
    schedule = make(12, 1, 4, 3)
    assert all(isinstance(time, int) for time in (*schedule.segment_times, *schedule.measurement_times))
    assert schedule.measurement_times == (3, 6, 9, 12)


@pytest.mark.parametrize("what", ["process", "measurement"])
def test_noise_has_its_covariance_also_where_that_is_singular(what):
    states, y = simulated(noises(), RUNS, 4, 2)
    drawn, cov = (states[:, -1], SINGULAR) if what == "process" else (y[:, -1], SINGULAR[:2, :2])
    found = drawn.T @ drawn / RUNS
    spread = np.sqrt((cov**2 + np.outer(np.diag(cov), np.diag(cov))) / RUNS)
    assert (abs(found - cov) < 4 * spread).all()
    np.testing.assert_allclose(drawn[:, 0], 2 * drawn[:, 1], atol=1e-12)


def test_steps_measurements_and_trajectories_have_independent_noise():
    states, y = simulated(noises(), RUNS, 4, 1)
    drawn = np.concatenate([states[:, 1:, 0], y[:, :, 0]], axis=1)
    drawn = np.concatenate([drawn[:-1], drawn[1:]], axis=1) / np.sqrt(0.5)
    correlation = drawn.T @ drawn / len(drawn) - np.eye(drawn.shape[1])
    assert abs(correlation).max() < 4.5 / np.sqrt(RUNS)


def test_the_transition_is_applied_with_the_number_of_each_step_and_its_inputs():
    """x+ = (k + 1) x + u(k), as a loop in NumPy."""
    push = jnp.array([3.0, -1.0, 4.0, 1.0, -5.0, 9.0])
    moved = noises(
        interval=3,
        transition=lambda k, x, w, u: (k + 1) * x + u + 0.0 * w,
        inputs=lambda k: push[k],
        sample=lambda key: jnp.array([1, 2, 3]),
    )
    states, _ = simulated(moved, 1, 6, 1)
    x, expected = np.array([1.0, 2.0, 3.0]), [np.array([1.0, 2.0, 3.0])]
    for k in range(6):
        x = (k + 1) * x + float(push[k])
        expected.append(x)
    np.testing.assert_allclose(states[0], np.array(expected), rtol=1e-14)


def test_how_steps_are_grouped_leaves_truth_and_noise_as_they_were():
    """Segments of one step and of three, with the same states at the ends that they share."""
    walk = noises(interval=3, transition=lambda k, x, w: 0.9 * x + w)
    (fine, seen), (coarse, seen_too) = (simulated(walk, 4, 12, output) for output in (1, 3))
    np.testing.assert_allclose(fine[:, ::3], coarse, rtol=1e-13)
    np.testing.assert_allclose(seen, seen_too, rtol=1e-13)


def test_without_an_interval_nothing_is_measured():
    assert simulated(noises(interval=None), 2, 4, 2)[1].shape == (2, 0, 2)


def test_a_function_that_is_linear_only_at_the_first_step_is_not_taken_for_linear():
    """k x^2 is zero at k = 0."""
    bent = noises(transition=lambda k, x, w: x + k * x**2 + w)
    with pytest.raises(ConfigError, match="transition is not linear"):
        nb.filters.build("kalman", bent)
