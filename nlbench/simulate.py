"""Truth and measurements of one trajectory, from a key that depends on (seed, trajectory number, purpose) alone.

Every filter of an experiment sees the same truth and noise, whatever the block, thread, device or filter: that is what
pairs their errors. Drifts without noise are integrated by the staged RK4 of `moments.integrate`; with process noise the
step is diffrax's Euler (Ito) on increments drawn beforehand. In discrete time a step is the transition.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, expand
from nlbench.moments.integrate import fixed_rk4
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import Sets

if TYPE_CHECKING:
    from nlbench.schedule import Schedule
    from nlbench.systems.system import System

INITIAL, MEASUREMENT, PROCESS, FILTER = range(4)  # purposes of random numbers


class Trajectory(NamedTuple):
    """A trajectory by its 64-bit number, in 32-bit words; where initial states are drawn in sets, also the number of
    the first member of its set, and its own place in the set."""

    high: Any
    low: Any
    first_high: Any
    first_low: Any
    member: Any


def seed_key(seed_high: Any, seed_low: Any) -> Any:
    """The key of a 64-bit seed, given in 32-bit words."""
    return jax.random.fold_in(jax.random.key(seed_low), seed_high)


def trajectory_key(key: Any, high: Any, low: Any, purpose: int) -> Any:
    """The key of one trajectory for one purpose: both words of its number are folded in."""
    return jax.random.fold_in(jax.random.fold_in(jax.random.fold_in(key, high), low), purpose)


def initial_state(system: System | DiscreteSystem, key: Any, trajectory: Trajectory) -> Any:
    """x(0), (n,): as the system samples it, or normal with its initial moments."""
    if isinstance(system.sample, Sets):
        lows = trajectory.first_low + jnp.arange(system.sample.size, dtype=jnp.uint32)
        highs = trajectory.first_high + (lows < trajectory.first_low).astype(jnp.uint32)
        keys = jax.vmap(lambda high, low: trajectory_key(key, high, low, INITIAL))(highs, lows)
        normals = jax.vmap(lambda each: jax.random.normal(each, (system.states,)))(keys)
        return jnp.asarray(system.sample.transform(normals))[trajectory.member]
    own = trajectory_key(key, trajectory.high, trajectory.low, INITIAL)
    if system.sample is not None:
        return jnp.asarray(system.sample(own), float)
    return jnp.asarray(system.initial.mean, float) + root(system.initial.cov) @ jax.random.normal(
        own, (system.states,)
    )


class Simulated(NamedTuple):
    """Of one trajectory: states at the ends of the schedule's segments, the start first, (segments + 1, n);
    measurements at fixed times (M, m); noise of the sightings (K, m); key of the filters' own random numbers, as plain
    numbers, the same for all filters."""

    states: Any
    measurements: Any
    noise: Any
    key: Any


def simulate(
    system: System | DiscreteSystem, schedule: Schedule, key: Any, trajectory: Trajectory
) -> Simulated:
    """The truth, and what is measured of it or will be."""
    start = initial_state(system, key, trajectory)
    own = trajectory_key(key, trajectory.high, trajectory.low, PROCESS)
    states = jnp.concatenate([start[None], path(system, schedule, own, start)])
    own = trajectory_key(key, trajectory.high, trajectory.low, MEASUREMENT)
    count = schedule.sightings or schedule.measurements
    variance = np.asarray(system.measurement_cov, float)
    if schedule.continuous:  # white noise of that spectral density, as a sample held over a step
        variance = variance / schedule.step
    noise = jax.random.normal(own, (count, len(variance))) @ root(variance)
    drawing = jax.random.key_data(trajectory_key(key, trajectory.high, trajectory.low, FILTER))
    if not schedule.measurements:
        return Simulated(states, jnp.zeros((0, system.measurements)), noise, drawing)
    times = jnp.asarray(schedule.measurement_times)
    every = schedule.measured_every
    measured = states[:-1] if schedule.continuous else states[every::every]
    y = jax.vmap(lambda t, x, v: _measured(system, t, x, v))(times, measured, noise)
    return Simulated(states, y, noise[:0], drawing)


def _measured(system: System | DiscreteSystem, t: Any, x: Any, v: Any) -> Any:
    """What is measured at (t, x) with noise v, (m,)."""
    if isinstance(system, DiscreteSystem):
        return _stacked(system.observe_with_noise(t, x, v))
    return _stacked(system.observe(t, x)) + v


def path(system: System | DiscreteSystem, schedule: Schedule, key: Any, start: Any) -> Any:
    """States at the ends of the segments, (segments, n), from `start`."""
    if isinstance(system, DiscreteSystem):
        return _transitions(system, schedule, key, start)
    advance = _deterministic if system.diffusion is None else _stochastic
    return advance(system, schedule, key, start)


def _transitions(system: DiscreteSystem, schedule: Schedule, key: Any, start: Any) -> Any:
    steps = (schedule.segments, schedule.segment_steps)
    noise = jax.random.normal(key, (*steps, system.noises)) @ root(system.process_cov)

    def step(x: Any, given: tuple[Any, Any]) -> tuple[Any, None]:
        return _stacked(system.transition_with_inputs(given[0], x, given[1])), None

    def segment(x: Any, given: tuple[Any, Any]) -> tuple[Any, Any]:
        k, noise = given
        x = jax.lax.scan(step, x, (k + jnp.arange(schedule.segment_steps), noise))[0]
        return x, x

    return jax.lax.scan(segment, start, (jnp.asarray(schedule.segment_times[:-1]), noise))[1]


def _deterministic(system: System, schedule: Schedule, key: Any, start: Any) -> Any:
    integrator = fixed_rk4()

    def field(t: Any, x: Tensor) -> Tensor:
        return expand(system.drift_with_inputs, t, list(x), 0).value.dense()

    def segment(x: Tensor, t: Any) -> tuple[Tensor, Any]:
        x = integrator.integrate(field, t, schedule.step, schedule.segment_steps, x)
        return x, jnp.stack(list(x))

    first = Tensor.from_array(start, ((0,),)).dense()
    return jax.lax.scan(segment, first, jnp.asarray(schedule.segment_times[:-1]))[1]


class GivenIncrement(diffrax.AbstractPath):
    """A Brownian path of which only the increment over the step at hand is known."""

    increment: Any
    t0 = 0.0
    t1 = math.inf

    def evaluate(self, t0: Any, t1: Any = None, left: bool = True) -> Any:
        """The increment, whatever the interval."""
        return self.increment


def _stochastic(system: System, schedule: Schedule, key: Any, start: Any) -> Any:
    diffusion = system.diffusion
    assert diffusion is not None
    s = jax.eval_shape(diffusion, 0.0, start).shape[1]
    V = np.eye(s) if system.diffusion_cov is None else np.asarray(system.diffusion_cov)
    steps = (schedule.segments, schedule.segment_steps)
    increments = jax.random.normal(key, (*steps, s)) @ root(V * schedule.step)
    drift = diffrax.ODETerm(lambda t, x, args: _stacked(system.drift_with_inputs(t, x)))
    solver = diffrax.Euler()

    def step(x: Any, given: tuple[Any, Any]) -> tuple[Any, None]:
        t, increment = given
        noise = diffrax.ControlTerm(
            lambda t, x, args: jnp.asarray(diffusion(t, x)), GivenIncrement(increment)
        )
        terms: Any = diffrax.MultiTerm(drift, noise)
        return solver.step(terms, t, t + schedule.step, x, None, None, False)[0], None

    def segment(x: Any, given: tuple[Any, Any]) -> tuple[Any, Any]:
        t, increments = given
        times = t + schedule.step * jnp.arange(schedule.segment_steps)
        x = jax.lax.scan(step, x, (times, increments))[0]
        return x, x

    return jax.lax.scan(segment, start, (jnp.asarray(schedule.segment_times[:-1]), increments))[1]


def root(cov: Any) -> np.ndarray:
    """The symmetric square root of a covariance known beforehand, which may be singular."""
    values, vectors = np.linalg.eigh(np.asarray(cov, float))
    return (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T


def _stacked(y: Any) -> Any:
    """An array, also where a system returned a tuple of scalars."""
    return jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
