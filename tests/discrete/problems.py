"""Problems of the literature in discrete time, and truth and filters along many runs of them."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import nlbench as nb


class Problem(NamedTuple):
    """truth: (key, steps) -> states (steps, n), of which filters estimate the first `scored`."""

    system: nb.DiscreteSystem
    truth: object
    steps: int
    scored: int


def wrapped(y, h):
    return jnp.mod(y - h + jnp.pi, 2 * jnp.pi) - jnp.pi


def simulated(system, start):
    """Truth of a system from a start drawn by `start(key)`."""

    def truth(key, steps):
        first, noise = jax.random.split(key)
        root = np.diag(np.sqrt(np.diag(system.process_cov)))  # these problems have independent noises
        w = jax.random.normal(noise, (steps, system.noises)) @ root

        def advance(x, given):
            x = system.transition(given[0], x, given[1])
            return x, x

        return jax.lax.scan(advance, start(first), (jnp.arange(steps), w))[1]

    return truth


def ungm():
    """x_k of the literature is the state at step k; its cosine, of k - 1, is that of the index a step starts from."""
    system = nb.DiscreteSystem(
        transition=lambda k, x, w: x / 2 + 25 * x / (1 + x**2) + 8 * jnp.cos(1.2 * k) + w,
        observe=lambda k, x, v: x**2 / 20 + v,
        process_cov=np.eye(1),
        measurement_cov=np.eye(1),
        initial=nb.Moments([0.1], [[1.0]]),
    )
    return Problem(system, simulated(system, lambda key: jnp.array([0.1])), 500, 1)


def bearings():
    """Two sensors see the bearings of a target that turns three times; the filter thinks it goes straight."""
    dt, q = 0.01, 0.1
    F = np.eye(4) + dt * np.eye(4, k=2)
    Q = q * np.kron(np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]]), np.eye(2))
    sensors = np.array([[-1.0, -2.0], [1.0, 1.0]])

    def angles(k, x, v):
        return jnp.arctan2(x[1] - sensors[:, 1], x[0] - sensors[:, 0]) + v

    def truth(key, steps):
        k = jnp.arange(1, steps + 1)
        turning = ((k >= 50) & (k <= 100)) | ((k >= 200) & (k <= 250)) | ((k >= 350) & (k <= 400))
        rate = turning * (jnp.pi / 2 / 51 / dt + 0.01 * jax.random.normal(key, (steps,)))

        def advance(x, a):
            # The exact motion over dt at a constant rate of turn a: the velocity turns by -a dt.
            angle = a * dt
            half = jnp.sinc(angle / 2 / jnp.pi) * dt  # the chord per unit speed
            turn = lambda by: jnp.array([[jnp.cos(by), jnp.sin(by)], [-jnp.sin(by), jnp.cos(by)]])  # noqa: E731
            x = jnp.concatenate([x[:2] + half * turn(angle / 2) @ x[2:], turn(angle) @ x[2:]])
            return x, x

        start = jnp.array([0.0, 0.0, 1.0, 0.0])
        return jnp.concatenate([start[None], jax.lax.scan(advance, start, rate[:-1])[1]])

    system = nb.DiscreteSystem(
        transition=lambda k, x, w: jnp.asarray(F) @ x + w,
        observe=angles,
        process_cov=Q,
        measurement_cov=0.05**2 * np.eye(2),
        initial=nb.Moments(np.zeros(4), np.diag([0.1, 0.1, 10.0, 10.0])),
        residual=wrapped,
    )
    return Problem(system, truth, 500, 2)


def reentry():
    """A vehicle enters the atmosphere, its drag unknown; a radar on the ground sees range and angle."""
    beta0, H0, gravity, R0, dt = -0.59783, 13.406, 3.9860e5, 6374.0, 0.1
    noise = np.array([2.4064e-5, 2.4064e-5, 1e-6])

    def transition(k, x, w):
        distance, speed = jnp.hypot(x[0], x[1]), jnp.hypot(x[2], x[3])
        drag = beta0 * jnp.exp(x[4]) * jnp.exp((R0 - distance) / H0) * speed
        pull = -gravity / distance**3
        rate = jnp.stack([x[2], x[3], drag * x[2] + pull * x[0], drag * x[3] + pull * x[1], 0.0])
        return x + dt * rate + jnp.concatenate([jnp.zeros(2), w])

    def radar(k, x, v):
        return jnp.stack([jnp.hypot(x[0] - R0, x[1]), jnp.arctan2(x[1], x[0] - R0)]) + v

    mean = np.array([6500.4, 349.14, -1.8093, -6.7967, 0.0])
    system = nb.DiscreteSystem(
        transition=transition,
        observe=radar,
        process_cov=np.diag(noise),
        measurement_cov=np.diag([1e-3**2, 0.17e-3**2]),
        initial=nb.Moments(mean, np.diag([1e-6] * 4 + [1.0])),
        residual=lambda y, h: jnp.stack([y[0] - h[0], wrapped(y[1], h[1])]),
    )
    quiet = nb.DiscreteSystem(
        transition, radar, np.diag([*noise[:2], 0.0]), system.measurement_cov, system.initial
    )

    def start(key):
        return jnp.asarray(mean) + jnp.append(1e-3 * jax.random.normal(key, (4,)), 0.6932)

    return Problem(system, simulated(quiet, start), 2000, 2)


def squared_errors(problem, names, runs, seed):
    """Squared errors of each filter, (name, options), along the same runs, summed over what is scored:
    dict of (runs, steps) arrays."""
    system = problem.system
    filters = {
        name: nb.filters.build(name.split("/")[0], system, **options) for name, options in names.items()
    }
    root = np.diag(np.sqrt(np.diag(system.measurement_cov)))

    def run(key):
        motion, noise, own = jax.random.split(key, 3)
        x = problem.truth(motion, problem.steps)
        v = jax.random.normal(noise, (problem.steps, len(root))) @ root
        k = jnp.arange(problem.steps)
        y = jax.vmap(lambda k, x, v: system.observe(k, x, v))(k + 1, x, v)
        errors = {}
        for name, f in filters.items():

            def cycle(state, given, f=f):
                k, y = given
                state, _ = f.update(f.predict(state, k, k + 1), k + 1, y)
                return state, f.moments(state).mean

            start = f.init(system.initial, own)
            means = jax.lax.scan(cycle, start, (k, y))[1]
            errors[name] = jnp.sum((x - means)[:, : problem.scored] ** 2, 1)
        return errors

    keys = jax.random.split(jax.random.key(seed), runs)
    return {name: np.asarray(error) for name, error in jax.jit(jax.vmap(run))(keys).items()}
