"""Claim: kinks and jumps are found where derivatives by jax show none, element by element, and nowhere else."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import nlbench as nb
from nlbench.algebra import breaks
from nlbench.discrete.catalogue import PropagatedOptions
from nlbench.discrete.problem import bends, observation, transition
from nlbench.systems.discrete import DiscreteSystem

A = np.array([[0.9, 0.1], [0.0, 1.0]])
STRAIGHT = {
    "matrix": lambda g, z: jnp.asarray(A) @ z + g[0],
    "a branch of what is given": lambda g, z: jnp.where(g[0] > 0, z, 2 * z),
    "a kink of what is given": lambda g, z: z + jnp.abs(g[0]),
    "a kink of another element": lambda g, z: jnp.stack([jnp.abs(jnp.stack([g[0], z[0]]))[0], z[1]]),
    "a loop": lambda g, z: jax.lax.fori_loop(0, 3, lambda i, x: jnp.asarray(A) @ x, z),
    "a condition of what is given": lambda g, z: jax.lax.cond(g[0] > 0, lambda: z, lambda: 2 * z),
    "a smooth curve": lambda g, z: jnp.sin(z) * z[::-1],
    "sums and solves": lambda g, z: jnp.cumsum(jnp.linalg.solve(jnp.asarray(A), jnp.roll(z, 1))),
}
BROKEN = {
    "abs": lambda g, z: jnp.abs(z),
    "max": lambda g, z: jnp.maximum(z, 0.0),
    "clip": lambda g, z: jnp.clip(z, -1.0, 1.0),
    "where": lambda g, z: jnp.where(z > 0, z, 2 * z),
    "sign": lambda g, z: z + jnp.sign(z[::-1]),
    "round": lambda g, z: jnp.round(z),
    "floor": lambda g, z: z - jnp.floor(z),
    "mod": lambda g, z: z % 1.0,
    "interp": lambda g, z: jnp.interp(z, jnp.arange(3.0), jnp.array([0.0, 1.0, 3.0])),
    "relu": lambda g, z: jax.nn.relu(z),
    "integers": lambda g, z: z.astype(int).astype(float),
    "index": lambda g, z: jnp.array([1.0, 2.0, 3.0])[z.astype(int)],
    "sort": lambda g, z: jnp.sort(z),
    "largest": lambda g, z: z + jnp.argmax(z),
    "a loop": lambda g, z: jax.lax.fori_loop(0, 3, lambda i, x: jnp.abs(x), z),
    "a test": lambda g, z: jax.lax.while_loop(lambda x: x[0] < 3, lambda x: x + 1, z),
    "a condition": lambda g, z: jax.lax.cond(z[0] > 0, lambda: z, lambda: 2 * z),
}


@pytest.mark.parametrize("name", STRAIGHT)
def test_what_has_no_kink_is_let_through(name):
    assert not breaks(STRAIGHT[name], 1, 2)


@pytest.mark.parametrize("name", BROKEN)
def test_a_kink_or_a_jump_is_found(name):
    assert breaks(BROKEN[name], 1, 2)


@pytest.mark.parametrize("name", BROKEN)
def test_kalman_refuses_it_as_it_refuses_a_curve(name):
    system = DiscreteSystem(
        lambda k, x, w: BROKEN[name](None, x) + w, lambda k, x, v: x + v, np.eye(2), np.eye(2),
        nb.Moments(np.zeros(2), np.eye(2)),
    )  # fmt: skip
    with pytest.raises(nb.errors.ConfigError, match="kalman: transition is not linear"):
        nb.filters.build("kalman", system)


@pytest.mark.parametrize("name", nb.systems.available())
def test_noise_enters_the_registered_systems_linearly(name):
    """So none of them costs a filter points for its noise."""
    system = nb.systems.build(name)
    if isinstance(system, DiscreteSystem):
        assert observation(system, PropagatedOptions()).linear
        assert transition(system).linear


def scalar(transition, observe=lambda k, x, v: x + v):
    return DiscreteSystem(
        transition, observe, np.eye(1), np.eye(1), nb.Moments(np.zeros(1), 1e-6 * np.eye(1))
    )


@pytest.mark.parametrize(
    ("transition", "mean", "variance"),
    [
        # x near 0, w ~ N(0, 1): E max(w, 0) = 1/sqrt(2 pi), E max(w, 0)^2 = 1/2; E |w| = sqrt(2/pi), E w^2 = 1
        (lambda k, x, w: jnp.maximum(x + w, 0.0), 1 / np.sqrt(2 * np.pi), 1 / 2 - 1 / (2 * np.pi)),
        (lambda k, x, w: x + jnp.abs(w), np.sqrt(2 / np.pi), 1 - 2 / np.pi),
    ],
    ids=["max", "abs"],
)
@pytest.mark.parametrize(
    ("name", "options", "within"),
    [("ghkf", {"points": 101}, 0.02), ("ukf", {}, 0.35), ("ensemble", {"particles": 40_000}, 0.02)],
)  # fmt: skip
def test_points_see_noise_under_a_kink(name, options, within, transition, mean, variance):
    """A rule of three points sees it as roughly as three points can; many see it as it is."""
    f = nb.filters.build(name, scalar(transition), **options)
    moments = f.moments(f.predict(f.init(f.system.initial), 0, 1))
    assert abs(moments.mean[0] - mean) < within
    assert abs(moments.cov[0, 0] - variance) < within


def test_a_particle_filter_refuses_noise_under_a_kink():
    system = scalar(lambda k, x, w: x + w, lambda k, x, v: jnp.clip(x + v, -1.0, 1.0))
    with pytest.raises(nb.errors.ConfigError, match="noise enters the measurement nonlinearly"):
        nb.filters.build("bootstrap", system)
    assert bends(system, PropagatedOptions()) == "observe"
