"""A filter whose state is a mean and a covariance, bound from the three functions in which such filters differ."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp

from nlbench.discrete.correction import Gaussian, symmetric
from nlbench.discrete.problem import observation, transition, variables
from nlbench.discrete.time import Clock
from nlbench.filters.filter import Filter
from nlbench.moments import integrate as integration
from nlbench.moments.moments import Components, Moments, to_components
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.systems.system import System


def build(
    name: str,
    system: System | DiscreteSystem,
    options: Any,
    step: Callable,
    slope: Callable,
    update: Callable,
    rule: Callable[[int], Any] | None = None,
) -> Filter:
    """The filter made of

    step: (transition, k, prior) -> the Gaussian after the transition, for a system in discrete time.
    slope: (system, t, prior) -> the Gaussian's time derivative, for a system in continuous time.
    update: (observation, t, prior, y) -> (posterior, UpdateInfo).
    rule: (variables) -> the points of expectations, laid once here so that what cannot be laid is refused early.
    """
    seen = observation(system, options)
    if rule is not None:
        rule(system.states)
        rule(variables(seen, system.states))

    if isinstance(system, DiscreteSystem):
        motion = transition(system)
        if rule is not None:
            rule(variables(motion, system.states))
        clock = Clock.of_steps(lambda state, k: symmetrised(step(motion, k, state)))
    else:
        integrator = integration.fixed_rk4()
        field = lambda t, state: symmetrised(slope(system, t, state))  # noqa: E731
        clock = Clock.of_integrals(
            lambda state, t, h, count: integrator.integrate(field, t, h, count, state),
            options.step or system.default_step,
        )

    def updated(state: Gaussian, t: Any, y: Any, key: Any = None, sighting: Any = None) -> Any:
        sighted = seen if sighting is None else observation(system.sighted(sighting), options)
        return update(sighted, t, state, jnp.asarray(y))

    sightings = getattr(system, "sightings", None)
    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: gaussian(moments),
        predict=lambda state, t0, t1, key=None: clock.predict(state, t0, t1),
        update=updated,
        moments=lambda state: Moments(*state),
        rates=lambda state, t, y=None: Moments(*clock.rates(name, lambda: slope(system, t, state))),
        integrate=clock.integrate,
        components=components,
        angle=(lambda state: sightings.angle(state.mean)) if sightings else None,
        limiter=seen.limiter,
    )


def gaussian(moments: Moments) -> Gaussian:
    """Mean and covariance of moments; higher ones are not carried."""
    return Gaussian(jnp.asarray(moments.mean, float), jnp.asarray(moments.cov, float))


def components(state: Gaussian) -> Components:
    """The unique components."""
    return to_components(Moments(*state), 2)


def symmetrised(state: Gaussian) -> Gaussian:
    """With a covariance that is symmetric to the last bit."""
    return Gaussian(state.mean, symmetric(state.cov))
