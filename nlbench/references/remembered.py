"""The near-optimal reference of a system without process noise, as a filter: it remembers its measurements.

Moments are computed when they are asked for, from all measurements so far (`initial_posterior`). What runs along is an
extended Kalman filter of the companion system, which says when a sighting is due: so the reference makes its own
sightings, at times that depend on nothing but what it has measured. Cost: that filter, and at the end one weighted
cloud of points for each measurement.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor
from nlbench.filters.filter import Filter, UpdateInfo, central_angle
from nlbench.moments import integrate as integration
from nlbench.moments.equations import rates
from nlbench.moments.moments import Components, Moments, dense, to_components, to_full
from nlbench.references.initial_posterior import posterior_track
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.kalman import kalman
from nlbench.updates.measurement import gain, linearise

if TYPE_CHECKING:
    from nlbench.systems.exact import InitialPosterior
    from nlbench.systems.system import System

KEY = 1969  # of the points' rotations, which are the same for all trajectories


class State(NamedTuple):
    """Time; how many measurements were made, and when (M,), infinite for those to come; the measurements (M, m); the
    companion's moments."""

    t: Any
    made: Any
    times: Any
    y: Any
    companion: Components


def build(system: System, record: InitialPosterior) -> Filter:
    """The reference as a filter. `init` takes the prior from the system, whatever moments it is given."""
    companion = record.companion or system
    integrator = integration.fixed_rk4()

    def init(moments: Moments, key: Any = None) -> State:
        none = jnp.full(record.most, jnp.inf)
        nothing = jnp.zeros((record.most, system.measurements))
        return State(jnp.zeros(()), jnp.zeros((), int), none, nothing, to_components(companion.initial, 1))

    def integrate(state: State, t: Any, h: Any, count: Any) -> State:
        field = lambda t, y: dense(rates(companion, 1, t, y))  # noqa: E731
        carried = integrator.integrate(field, t, h, count, state.companion)
        return state._replace(t=jnp.asarray(t + h * count, float), companion=carried)

    def predict(state: State, t0: Any, t1: Any, key: Any = None) -> State:
        longest = system.default_step or (t1 - t0) / 10
        count = jnp.maximum(1, jnp.ceil((t1 - t0) / longest - 1e-9)).astype(int)
        return integrate(state, t0, (t1 - t0) / count, count)._replace(t=jnp.asarray(t1, float))

    def update(
        state: State, t: Any, y: Any, key: Any = None, sighting: Any = None
    ) -> tuple[State, UpdateInfo]:
        state = state._replace(t=jnp.asarray(t, float))
        y = jnp.atleast_1d(jnp.asarray(y, float))
        number = state.made if sighting is None else sighting
        seen = companion.sighted(number) if companion.sightings else companion
        measurement = linearise(seen, t, state.companion, y, missing=True)
        gained = gain(state.companion.cov, measurement)
        z = gained.turned(measurement.z)
        after = kalman(state.companion, gained, z, z)
        remembered = State(
            state.t,
            state.made + 1,
            state.times.at[state.made].set(state.t),
            state.y.at[state.made].set(y),
            dense(after.moments),
        )
        return remembered, _info(system, _now(system, record, state), state, y)

    def moments(state: State) -> Components:
        return _now(system, record, state)

    return Filter(
        name="exact",
        system=system,
        init=init,
        predict=predict,
        update=update,
        moments=lambda state: to_full(moments(state)),
        rates=lambda state, t, y=None: _rates(system, record, state._replace(t=jnp.asarray(t, float))),
        integrate=integrate,
        components=moments,
        angle=lambda state: central_angle(companion, state.companion.mean),
        history=lambda state, times: _history(system, record, state, times),
    )


def _history(system: System, record: InitialPosterior, state: State, times: Any) -> Components:
    """Moments at the times (T,), components (T,), each given what had been measured by then."""

    def observe(number: Any, x: Any) -> Any:
        seen = system.sighted(number) if system.sightings else system
        h = seen.observe(state.times[number], x)
        return jnp.stack(h) if isinstance(h, tuple) else h

    track = posterior_track(
        record.flow,
        observe,
        system.innovation,
        system.initial,
        system.measurement_cov,
        times
        * (1 + 1e-12),  # an output at the time of a measurement comes after it, however that was rounded
        state.times,
        state.y,
        jax.random.key(KEY),
        record.radii,
        record.turns,
    )
    forgotten = jnp.where(state.made > record.most, jnp.nan, 0.0)  # more than there is room for
    return Components(
        *(
            Tensor.symmetric(system.states, order, lambda index, a=array: a[(..., *index)] + forgotten)
            for order, array in enumerate(track[:3], start=1)
        )
    )


def _now(system: System, record: InitialPosterior, state: State) -> Components:
    return jax.tree.map(lambda entry: entry[0], _history(system, record, state, state.t[None]))


def _rates(system: System, record: InitialPosterior, state: State) -> Moments:
    """Derivatives of the moments, the data held."""
    moments = lambda t: to_full(_now(system, record, state._replace(t=t)))  # noqa: E731
    return jax.jvp(moments, (state.t,), (jnp.ones_like(state.t),))[1]


def _info(system: System, prior: Components, state: State, y: Any) -> UpdateInfo:
    """Of the normal law that has the moments of the prediction, to first order."""
    seen = system.sighted(state.made) if system.sightings else system
    measurement = linearise(seen, state.t, prior, y, missing=True)
    gained = gain(prior.cov, measurement)
    return UpdateInfo(
        innovation=measurement.z.to_array(),
        innovation_cov=gained.S.to_array(),
        log_likelihood=gaussian_log_density(
            gained.turned(measurement.z), gained, measurement.taken, measurement.slack
        ),
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )
