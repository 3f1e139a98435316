"""A filter whose state is a mean and a covariance, bound from the three functions in which such filters differ."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp

from nlbench.discrete.correction import Gaussian, Spread, symmetric
from nlbench.discrete.problem import observation, transition, variables
from nlbench.discrete.propagation import Approximation, moment_rates, propagator
from nlbench.discrete.roots import nonnegative_root
from nlbench.discrete.time import Clock
from nlbench.filters.filter import Filter
from nlbench.moments.integrate import fixed_rk4
from nlbench.moments.moments import Components, Moments, to_components
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.systems.system import System


def build(
    name: str,
    system: System | DiscreteSystem,
    options: Any,
    step: Callable,
    local: Callable,
    update: Callable,
    rule: Callable[[int], Any] | None = None,
) -> Filter:
    """Bind the filter that carries a `Spread`, made of

    step: (transition, k, prior) -> the Spread after the transition, for a system in discrete time.
    local: (system, t, mean, columns) -> Local, see `propagation`, for a system in continuous time.
    update: (observation, t, prior, y) -> (posterior, UpdateInfo).
    rule: (variables) -> the points of expectations, laid once here so that what cannot be laid is refused early.
    """
    if rule is not None:
        rule(system.states)
        rule(variables(observation(system, options), system.states))

    if isinstance(system, DiscreteSystem):
        motion = transition(system)
        if rule is not None:
            rule(variables(motion, system.states))
        clock = Clock.of_steps(lambda state, k: step(motion, k, state))
    else:
        clock = Clock.of_integrals(
            propagator(approximated(local, system), getattr(options, "propagation", "transition")),
            options.step or system.default_step,
        )

    def slope(state: Spread, t: Any) -> Gaussian:
        return moment_rates(approximated(local, system), t, Gaussian(state.mean, state.cov), state.root)

    return _bound(name, system, options, clock, slope, update, spread)


def build_with_covariance(
    name: str,
    system: System | DiscreteSystem,
    options: Any,
    step: Callable,
    slope: Callable,
    update: Callable,
) -> Filter:
    """Bind the filter that carries a `Gaussian`, whose covariance may lose positiveness, made of

    step, update: as for `build`. slope: (system, t, prior) -> the Gaussian's time derivative, in continuous time.
    """
    if isinstance(system, DiscreteSystem):
        motion = transition(system)
        clock = Clock.of_steps(lambda state, k: symmetrised(step(motion, k, state)))
    else:
        field = lambda t, state: symmetrised(slope(system, t, state))  # noqa: E731
        clock = Clock.of_integrals(
            lambda state, t, h, count: fixed_rk4().integrate(field, t, h, count, state),
            options.step or system.default_step,
        )
    return _bound(name, system, options, clock, lambda state, t: slope(system, t, state), update, gaussian)


def _bound(
    name: str,
    system: System | DiscreteSystem,
    options: Any,
    clock: Clock,
    slope: Callable,
    update: Callable,
    start: Callable[[Moments], Any],
) -> Filter:
    """Return the filter with the state that `start` makes of moments, and that has a `mean` and a `cov`."""
    seen = observation(system, options)

    def updated(state: Any, t: Any, y: Any, key: Any = None, sighting: Any = None) -> Any:
        sighted = seen if sighting is None else observation(system.sighted(sighting), options)
        return update(sighted, t, state, jnp.asarray(y))

    def rates(state: Any, t: Any, y: Any = None) -> Moments:
        return Moments(*clock.rates(name, lambda: symmetrised(slope(state, t))))

    sightings = getattr(system, "sightings", None)
    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: start(moments),
        predict=lambda state, t0, t1, key=None: clock.predict(state, t0, t1),
        update=updated,
        moments=lambda state: Moments(state.mean, symmetric(state.cov)),
        rates=rates,
        integrate=clock.integrate,
        components=lambda state: components(Gaussian(state.mean, state.cov)),
        angle=(lambda state: sightings.angle(state.mean)) if sightings else None,
        limiter=seen.limiter,
    )


def approximated(local: Callable, system: System) -> Approximation:
    """Return the approximation of the system, as `propagation` takes it."""
    return lambda t, mean, columns: local(system, t, mean, columns)


def gaussian(moments: Moments) -> Gaussian:
    """Return mean and covariance of moments; higher ones are not carried."""
    return Gaussian(jnp.asarray(moments.mean, float), jnp.asarray(moments.cov, float))


def spread(moments: Moments) -> Spread:
    """Return mean and root of moments."""
    mean, cov = gaussian(moments)
    return Spread(mean, nonnegative_root(cov))


def components(state: Gaussian) -> Components:
    """Return the unique components."""
    return to_components(Moments(*state), 2)


def symmetrised(state: Gaussian) -> Gaussian:
    """Return the Gaussian with a covariance that is symmetric to the last bit."""
    return Gaussian(state.mean, symmetric(state.cov))
