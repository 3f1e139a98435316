"""Moment filters: moment equations of some order between measurements, an update at them, a limiter and a guard.

An update is either one of `UPDATES`, which sees the linearised measurement, or one of `CURVED`, which looks beyond it.
Between measurements the moments follow `nlbench.moments.equations` (Culver 1969, (4.64)-(4.68)); at a measurement an
update of `nlbench.updates` turns prior into posterior. The state is the moments' unique components. Cost per step
O(n^(order + 1)), per update O(n^(order + 1)).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import shared, zeros
from nlbench.checks import refuse_exact
from nlbench.discrete.linearised import local
from nlbench.discrete.propagation import carried
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo, central_angle
from nlbench.moments import integrate as integration
from nlbench.moments.equations import fourth_moment_rate, rates
from nlbench.moments.moments import Components, Moments, dense, to_components, to_full
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.guard import either, fallback, guarded, integrable
from nlbench.updates.hermite3 import hermite3, sub1, sub2
from nlbench.updates.hermite4 import hermite4
from nlbench.updates.kalman import kalman
from nlbench.updates.limiter import limited
from nlbench.updates.measurement import Gain, Measurement, gain, linearise
from nlbench.updates.nonlinear import Outcome, Seen, see
from nlbench.updates.posterior import Posterior
from nlbench.updates.quadrature import direct, quadrature
from nlbench.updates.series import series
from nlbench.updates.tempering import tempering
from nlbench.updates.two_step import two_step

if TYPE_CHECKING:
    from nlbench.filters.catalogue import Options
    from nlbench.row import Row
    from nlbench.systems.system import System

MOST_NODES = 1_000_000  # of a product rule
UPDATES: dict[str, Callable] = {
    "kalman": kalman,
    "hermite3": hermite3,
    "sub1": sub1,
    "sub2": sub2,
    "hermite4": hermite4,
}


# What makes an update of a filter's options: the updates are functions (prior, seen) -> Outcome.
CURVED: dict[str, Callable[[Any], Callable[[Components, Seen], Outcome]]] = {
    "series": lambda options: partial(series, equations=options.equations),
    "tempering": lambda options: partial(
        tempering, steps=options.steps, measurement=options.measurement, equations=options.equations
    ),
    "two-step": lambda options: partial(
        two_step, steps=options.steps, equations=options.equations, closure=options.closure
    ),
    "direct": lambda options: partial(direct, points=options.points),
    "quadrature": lambda options: partial(quadrature, points=options.points),
}


def build(name: str, row: Row, system: System, options: Options) -> Filter:
    """The filter of a catalogue row, bound to a system measured at discrete times.

    Raises `ConfigError` where an update would integrate over too many nodes, or divide by the noise of a measurement
    that has none.
    """
    if row.update in CURVED:
        refuse_exact(name, system.measurement_cov)
    points = getattr(options, "points", 1)
    if points**system.states > MOST_NODES:
        raise ConfigError(
            f"{name}.points: {points} along each of {system.states} states are more than {MOST_NODES:,} nodes"
        )
    integrator = integration.build(**options.integrator.model_dump())
    updated = _curved_update if row.update in CURVED else _linear_update

    def by_moments(state: Components, t: Any, h: Any, count: Any) -> Components:
        return integrator.integrate(lambda t, y: dense(rates(system, row.order, t, y)), t, h, count, state)

    def by_transition(state: Components, t: Any, h: Any, count: Any) -> Components:
        def step(i: Any, state: Components) -> Components:
            mean, P, *_ = to_full(state)
            mean, Phi, noise = carried(partial(local, system), t + i * h, h, mean, jnp.eye(system.states))
            return to_components(Moments(mean, Phi @ P @ Phi.T + noise @ noise.T), row.order)

        return jax.lax.fori_loop(0, count, step, state)

    integrate = by_transition if getattr(options, "propagation", "moments") == "transition" else by_moments

    def predict(state: Components, t0: Any, t1: Any, key: Any = None) -> Components:
        h, count = integration.steps_between(t0, t1, options.step or system.default_step)
        return integrate(state, t0, h, count)

    def update(
        state: Components, t: Any, y: Any, key: Any = None, sighting: Any = None
    ) -> tuple[Components, UpdateInfo]:
        seen = system if sighting is None else system.sighted(sighting)
        return updated(seen, row, options, state, t, y)

    def state_rates(state: Components, t: Any, y: Any = None) -> Moments:
        found = rates(system, row.order, t, state)
        full = to_full(found._replace(fourth=None))
        if found.fourth is None:
            return full
        return full._replace(fourth=fourth_moment_rate(state, found).to_array())

    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: to_components(moments, row.order),
        predict=predict,
        update=update,
        moments=to_full,
        rates=state_rates,
        integrate=integrate,
        components=lambda state: state,
        angle=(lambda state: central_angle(system, state.mean)) if system.sightings else None,
        limiter=options.limiter,
    )


def _linear_update(
    system: System, row: Row, options: Options, state: Components, t: Any, y: Any
) -> tuple[Components, UpdateInfo]:
    """An update of `UPDATES`."""
    made = shared(partial(_updated, system, row, options, t), t, state, y, reused=True)
    # Where the guard fires the predictive density is Gaussian.
    density_ratio = jnp.where(made.fired, 0.0, made.nu)
    seen, gained = made.measurement, made.gain
    density = gaussian_log_density(gained.turned(seen.z), gained, seen.taken, seen.slack)
    info = UpdateInfo(
        innovation=seen.z.to_array(),
        innovation_cov=gained.S.to_array(),
        log_likelihood=density + jnp.log1p(density_ratio),
        nu=jnp.asarray(made.nu, float),
        guarded=made.fired,
    )
    return made.moments, info


class Updated(NamedTuple):
    """Posterior moments, whether the guard fired, and what the likelihood is made of."""

    moments: Components
    fired: Any
    nu: Any
    measurement: Measurement
    gain: Gain


def _updated(system: System, row: Row, options: Options, t: Any, state: Components, y: Any) -> Updated:
    measurement = linearise(system, t, state, y, options.missing)
    gained = gain(state.cov, measurement)
    z = clipped = measurement.z
    if options.limiter is not None:
        clipped = limited(z, gained.S, options.limiter)
        z = clipped if options.limiter_scope == "all" else z
    z, clipped = gained.turned(z), gained.turned(clipped)
    posterior = UPDATES[row.update](state, gained, z, clipped)
    moments, fired = posterior.moments, jnp.zeros((), bool)
    if options.guard == "sub1" and row.update != "kalman":
        prior = state if row.update == "hermite4" else state._replace(fourth=None)
        moments, fired = guarded(posterior, fallback(prior, gained, z))
    if row.order == 4 and moments.fourth is None:
        moments = moments._replace(fourth=zeros(system.states, 4))
    return Updated(dense(moments), fired, posterior.nu, measurement, gained)


def _curved_update(
    system: System, row: Row, options: Options, state: Components, t: Any, y: Any
) -> tuple[Components, UpdateInfo]:
    """An update of `CURVED`."""
    measurement = linearise(system, t, state, y, options.missing)
    gained = gain(state.cov, measurement)
    clipped = None if options.limiter is None else limited(measurement.z, gained.S, options.limiter)
    seen = see(system, t, state, y, measurement, gained, clipped)
    moments, nu, log_likelihood = CURVED[row.update](options)(state, seen)
    fired, safe = jnp.zeros((), bool), kalman(state, gained, seen.z, seen.z).moments
    safe = safe if row.order == 2 else fallback(state, gained, seen.z)
    if (
        row.update == "quadrature"
    ):  # where there is no density to integrate, Kalman's update is taken, and counted
        sound = integrable(state, gained)
        moments, nu = either(sound, moments, safe), jnp.where(sound, nu, 0.0)
        fired = ~sound & jnp.isfinite(gained.S[0, 0])
    if options.guard == "sub1":
        moments, lost = guarded(Posterior(moments, nu), safe)
        fired = fired | lost
    gaussian = gaussian_log_density(seen.z, gained, seen.taken, seen.slack)
    log_likelihood = jnp.where(fired, gaussian, log_likelihood)
    moments = dense(moments)
    if options.missing:  # nothing taken: the prior, to the last bit
        some = seen.taken > 0
        moments = jax.tree.map(lambda new, old: jnp.where(some, new, old), moments, state)
        log_likelihood = jnp.where(some, log_likelihood, 0.0)
    info = UpdateInfo(
        innovation=measurement.z.to_array(),
        innovation_cov=gained.S.to_array(),
        log_likelihood=log_likelihood,
        nu=jnp.asarray(nu, float),
        guarded=fired,
    )
    return moments, info
