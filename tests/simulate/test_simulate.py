"""Claim: truth and noise depend on (seed, trajectory, purpose) alone, and follow the system's equations."""

from __future__ import annotations

from itertools import combinations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlbench as nb
from nlbench import simulate as sim
from nlbench.schedule import make
from nlbench.systems.system import Sets
from tests.oracle_culver import flow


def key(seed=1969):
    return sim.seed_key(jnp.uint32(seed >> 32), jnp.uint32(seed & 0xFFFFFFFF))


def trajectory(number, set_size=1):
    first = number - number % set_size
    words = [number >> 32, number & 0xFFFFFFFF, first >> 32, first & 0xFFFFFFFF]
    return sim.Trajectory(*map(jnp.uint32, words), jnp.int32(number % set_size))


def culver(**parameters):
    return nb.systems.build("culver-scalar", **parameters)


def one(system, number=0, seed=1969, end=2.0, output=0.1, set_size=1, step=0.02):
    schedule = make(end, step, output, system.interval)
    states, y, *_ = jax.jit(lambda k, n: sim.simulate(system, schedule, k, n))(
        key(seed), trajectory(number, set_size)
    )
    return np.asarray(states), np.asarray(y), schedule


def many(system, count, end, step, interval):
    schedule = make(end, step, interval, interval)
    low, zero = jnp.arange(count, dtype=jnp.uint32), jnp.zeros(count, jnp.uint32)
    numbers = sim.Trajectory(zero, low, zero, low, zero)
    run = jax.jit(jax.vmap(lambda n: sim.simulate(system, schedule, key(), n)))
    states, y, *_ = run(numbers)
    return np.asarray(states), np.asarray(y), schedule


BIG = [0, 1, 5, 63, 64, 2**32 - 1, 2**32, 2**32 + 1, 2**32 + 5, 5 * 2**32, 2**33, 2**63, 2**64 - 1]


def test_every_trajectory_seed_and_purpose_has_its_own_draws():
    """Also where numbers agree in one 32-bit word, or have their words exchanged."""
    purposes = (sim.INITIAL, sim.MEASUREMENT, sim.PROCESS, sim.FILTER)
    seeds = (1969, 1970, 1969 + 2**32, 2**32)
    keys = [
        tuple(np.asarray(jax.random.key_data(sim.trajectory_key(key(seed), n.high, n.low, purpose))).tolist())
        for seed in seeds
        for n in map(trajectory, BIG)
        for purpose in purposes
    ]
    assert len(set(keys)) == len(keys) == len(seeds) * len(BIG) * len(purposes)


def test_trajectories_beyond_two_to_the_32_differ_in_truth_and_noise():
    runs = {number: one(culver(), number, end=0.2) for number in (3, 2**32 + 3, 2**33 + 3)}
    for a, b in combinations(runs.values(), 2):
        assert abs(a[0][0, 0] - b[0][0, 0]) > 1e-6
        assert np.abs(a[1] - b[1]).min() > 1e-9


def test_the_same_trajectory_is_the_same_alone_and_in_any_batch():
    system = culver()
    states, y, _ = many(system, 9, 0.4, 0.02, 0.1)
    for number in (0, 4, 8):
        alone = one(system, number, end=0.4)
        np.testing.assert_allclose(states[number], alone[0], rtol=1e-14)
        np.testing.assert_allclose(y[number], alone[1], rtol=1e-14)


def test_noise_is_the_same_whatever_the_truth():
    """Common random numbers: another ensemble or drift leaves the measurement noise as it was."""
    systems = [
        culver(),
        culver(ensemble="conditioned"),
        culver(dynamics="linear"),
        culver(measurement="quadratic"),
    ]
    noises = []
    for system in systems:
        states, y, schedule = one(system, 11)
        measured = states[schedule.measured_every :: schedule.measured_every]
        noises.append(y - np.stack([np.asarray(system.observe(0.0, x)) for x in measured]))
    for noise in noises[1:]:
        np.testing.assert_allclose(noise, noises[0], atol=1e-13)


def test_a_longer_interval_or_other_variance_leaves_the_initial_state():
    starts = {
        one(culver(interval=i, measurement_variance=r), 5)[0][0, 0] for i, r in ((0.1, 1.6), (0.5, 0.3))
    }
    assert len(starts) == 1


def test_truth_is_the_closed_form_flow():
    """RK4 with step .02 is within 1e-6 of the closed form, and 16 times closer at half the step."""
    errors = []
    for step in (0.02, 0.01):
        states, _, schedule = one(culver(), 17, step=step)
        exact = flow(np.array(schedule.segment_times), states[0, 0])
        errors.append(np.abs(states[:, 0] - exact).max())
    assert errors[0] < 1e-6
    assert 14 < errors[0] / errors[1] < 18


def test_truth_of_a_coupled_system_with_an_input_follows_scipy():
    def drift(t, x, u):
        return jnp.stack([x[1], -x[0] - 2 * x[1] * x[2] + u, jnp.zeros_like(x[0])])

    system = nb.System(
        drift=drift,
        observe=lambda t, x: x[:2],
        measurement_cov=np.eye(2),
        initial=nb.Moments(np.array([1.0, 0.0, 0.5]), np.diag([0.09, 0.09, 0.01])),
        inputs=lambda t: jnp.sin(3 * t),
        interval=0.25,
    )
    states, y, schedule = one(system, 2, end=1.0, output=0.5, step=0.005)
    assert y.shape == (4, 2)

    def numpy_drift(t, x):
        return [x[1], -x[0] - 2 * x[1] * x[2] + np.sin(3 * t), 0.0]

    exact = solve_ivp(
        numpy_drift, (0, 1), states[0], rtol=1e-11, atol=1e-12, t_eval=schedule.segment_times
    ).y.T
    np.testing.assert_allclose(states, exact, atol=1e-9)


def z_score(values, expected):
    return (values.mean() - expected) / (values.std() / np.sqrt(len(values)))


def test_initial_states_and_noise_have_the_covariances_given():
    """Sampling is normal with the initial moments; y - h has covariance R; the two are independent."""
    p0, r = np.array([[0.5, 0.2], [0.2, 0.3]]), np.array([[0.4, -0.1], [-0.1, 0.2]])
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=lambda t, x: x,
        measurement_cov=r,
        initial=nb.Moments(np.array([1.0, -2.0]), p0),
        interval=0.1,
    )
    states, y, _ = many(system, 4000, 0.2, 0.1, 0.1)
    e, v = states[:, 0] - np.array([1.0, -2.0]), y - states[:, 1:]
    for i in range(2):
        assert abs(z_score(e[:, i], 0)) < 4
        for j in range(2):
            assert abs(z_score(e[:, i] * e[:, j], p0[i, j])) < 4
            assert abs(z_score(v[:, 0, i] * v[:, 0, j], r[i, j])) < 4
            assert abs(z_score(v[:, 1, i] * v[:, 1, j], r[i, j])) < 4
            assert abs(z_score(v[:, 0, i] * v[:, 1, j], 0)) < 4
            assert abs(z_score(v[:, 0, i] * e[:, j], 0)) < 4


def test_process_noise_has_the_covariance_of_the_euler_scheme():
    """x+ = (I + F h) x + G w, w ~ N(0, V h): the covariance after k steps is known exactly."""
    h, f = 0.05, np.array([[0.0, 1.0], [-1.0, -0.5]])
    g, v = np.array([[0.2, 0.0], [0.1, 0.6]]), np.array([[1.0, 0.3], [0.3, 0.5]])
    system = nb.System(
        drift=lambda t, x: jnp.asarray(f) @ x,
        observe=lambda t, x: x[:1],
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.zeros(2), 0.1 * np.eye(2)),
        diffusion=lambda t, x: jnp.asarray(g),
        diffusion_cov=v,
        interval=0.5,
    )
    states, _, _ = many(system, 4000, 1.0, h, 0.5)
    p, transition = 0.1 * np.eye(2), np.eye(2) + h * f
    for _ in range(20):
        p = transition @ p @ transition.T + h * g @ v @ g.T
    x = states[:, -1]
    for i in range(2):
        assert abs(z_score(x[:, i], 0)) < 4
        for j in range(2):
            assert abs(z_score(x[:, i] * x[:, j], p[i, j])) < 4


def test_state_dependent_diffusion_is_read_at_the_start_of_the_step():
    """Ito: dx = x dw keeps E x = x0 for Euler, where a Stratonovich reading would grow by exp(t/2)."""
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.ones(1), 1e-12 * np.eye(1)),
        diffusion=lambda t, x: x[:, None],
        diffusion_cov=0.25 * np.eye(1),
        interval=0.5,
    )
    states, _, _ = many(system, 4000, 1.0, 0.05, 0.5)
    x = states[:, -1, 0]
    assert abs(z_score(x, 1.0)) < 4
    assert abs(z_score(x**2, (1 + 0.25 * 0.05) ** 20)) < 4


def test_known_states_and_exact_sensors_need_no_positive_definite_covariance():
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=lambda t, x: x,
        measurement_cov=np.diag([0.0, 0.2]),
        initial=nb.Moments(np.array([1.0, 2.0]), np.array([[0.09, 0.09], [0.09, 0.09]])),
        diffusion=lambda t, x: jnp.eye(2),
        diffusion_cov=np.diag([0.0, 0.3]),
        interval=0.1,
    )
    states, y, _ = one(system, 1, end=0.1, output=0.1)
    assert np.isfinite(states).all()
    assert np.isfinite(y).all()
    np.testing.assert_allclose(states[0, 0] - 1, states[0, 1] - 2, atol=1e-9)
    np.testing.assert_allclose(y[0, 0], states[-1, 0], atol=1e-12)
    np.testing.assert_allclose(states[-1, 0], states[0, 0], atol=1e-12)
    assert states[-1, 1] != states[0, 1]


@pytest.mark.parametrize("first", [0, 160, 2**32 - 80, 2**32 - 32])
def test_members_of_a_thesis_set_share_their_correction(first):
    """A set has sample mean 2 and variance .16 exactly, also where its numbers cross 2^32."""
    system = culver(ensemble="thesis-sets")
    draw = jax.jit(lambda n: sim.initial_state(system, key(), n))
    members = []
    for member in range(80):
        number = first + member
        words = [number >> 32, number & 0xFFFFFFFF, first >> 32, first & 0xFFFFFFFF]
        members.append(float(draw(sim.Trajectory(*map(jnp.uint32, words), jnp.int32(member)))[0]))
    x = np.array(members)
    assert len(set(members)) == 80
    assert x.mean() == pytest.approx(2.0, abs=1e-13)
    assert ((x - 2) ** 2).mean() == pytest.approx(0.16, abs=1e-13)


@pytest.mark.parametrize("first", [0, 2**32 - 3])
def test_every_member_of_a_set_draws_under_its_own_number(first):
    """Also past 2^32, where the low word starts again from zero and the high word must be carried."""
    system = nb.System(
        drift=lambda t, x: 0 * x,
        observe=lambda t, x: x,
        measurement_cov=np.eye(1),
        initial=nb.Moments(np.zeros(1), np.eye(1)),
        sample=Sets(6, lambda normals: normals),
    )
    for member in range(6):
        number = first + member
        words = [number >> 32, number & 0xFFFFFFFF, first >> 32, first & 0xFFFFFFFF]
        n = sim.Trajectory(*map(jnp.uint32, words), jnp.int32(member))
        own = sim.trajectory_key(key(), n.high, n.low, sim.INITIAL)
        np.testing.assert_array_equal(sim.initial_state(system, key(), n), jax.random.normal(own, (1,)))


def test_no_measurements_means_none_taken():
    _, y, _ = one(culver(measurement="none"))
    assert y.shape == (0, 1)
