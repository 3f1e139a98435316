"""Samples of the state, how they move and make a filter: what the ensemble and the particle filter share."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete.gaussian import components
from nlbench.discrete.problem import observation, stacked, transition
from nlbench.discrete.roots import square_root
from nlbench.discrete.time import Clock
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.integrate import fixed_rk4
from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.discrete.correction import Gaussian
    from nlbench.systems.system import System


def bind(
    name: str,
    system: System | DiscreteSystem,
    options: Any,
    start: Callable[[Any, Any], Any],
    update: Callable[..., tuple[Any, UpdateInfo]],
    whole: Callable[[Any], Gaussian],
) -> Filter:
    """A filter whose state has fields `x` (N, n) and `key`, plain numbers; `options.particles` is N.

    start: (x, key) -> state. update: (seen, prior, t, y) -> (state, UpdateInfo). whole: state -> mean and covariance.
    A key that is None is taken from the state.
    """
    seen = observation(system, options)
    ticks = clock(system, options.step or getattr(system, "default_step", None))
    sightings = getattr(system, "sightings", None)

    def keyed(state: Any, key: Any) -> Any:
        return state if key is None else state._replace(key=raw(key))

    def init(moments: Moments, key: Any = None) -> Any:
        carried, used = split(raw(key))
        return start(drawn(moments, used, options.particles), carried)

    def predict(state: Any, t0: Any, t1: Any, key: Any = None) -> Any:
        return ticks.predict(keyed(state, key), t0, t1)

    def updated(state: Any, t: Any, y: Any, key: Any = None, sighting: Any = None) -> tuple[Any, UpdateInfo]:
        sighted = seen if sighting is None else observation(system.sighted(sighting), options)
        return update(sighted, keyed(state, key), t, jnp.asarray(y))

    def rates(state: Any, t: Any, y: Any = None) -> Moments:
        raise ConfigError(f"{name}: its moments are those of a sample and have no time derivatives")

    return Filter(
        name=name,
        system=system,
        init=init,
        predict=predict,
        update=updated,
        moments=lambda state: Moments(*whole(state)),
        rates=rates,
        integrate=ticks.integrate,
        components=lambda state: components(whole(state)),
        random=True,
        angle=(lambda state: sightings.angle(whole(state).mean)) if sightings else None,
    )


def drawn(moments: Moments, key: Any, count: int) -> Any:
    """`count` states, (count, n), normal with the moments' mean and covariance."""
    mean, cov = (jnp.asarray(part, float) for part in moments[:2])
    return mean + jax.random.normal(key, (count, len(mean))) @ square_root(cov).T


def raw(key: Any) -> Any:
    """A key as plain numbers, which loops and maps carry like any array; None is the key of seed 0."""
    key = jax.random.key(0) if key is None else key
    return jax.random.key_data(key) if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else key


def split(numbers: Any) -> tuple[Any, Any]:
    """The key to carry on, as plain numbers, and one to use."""
    carried, used = jax.random.split(jax.random.wrap_key_data(numbers))
    return jax.random.key_data(carried), used


def clock(system: System | DiscreteSystem, longest: float | None) -> Clock:
    """How a state with fields `key` (as `raw` gives it) and `x` (N, n) goes on, each sample with noise of its own.

    In discrete time x+ = f(k, x, w). In continuous time, over a step h, the drift is integrated by RK4 and the noise of
    the step, G(t, x) w with w ~ N(0, V h) at the step's start, is added: Ito's reading, in distribution exact to first
    order in h.
    """
    move = _discrete(system) if isinstance(system, DiscreteSystem) else _continuous(system)

    def moved(state: Any, t: Any, h: Any) -> Any:
        key, used = split(state.key)
        return state._replace(key=key, x=move(used, t, h, state.x))

    if isinstance(system, DiscreteSystem):
        return Clock.of_steps(lambda state, k: moved(state, k, 1))

    def integrate(state: Any, t: Any, h: Any, count: Any) -> Any:
        return jax.lax.fori_loop(0, count, lambda i, state: moved(state, t + i * h, h), state)

    return Clock.of_integrals(integrate, longest)


def _discrete(system: DiscreteSystem) -> Callable:
    motion = transition(system)

    def move(key: Any, k: Any, h: Any, x: Any) -> Any:
        w = jax.random.normal(key, (len(x), len(motion.cov))) @ square_root(motion.cov).T
        return jax.vmap(lambda x, w: motion.function(k, x, w))(x, w)

    return move


def _continuous(system: System) -> Callable:
    field = jax.vmap(lambda t, x: stacked(system.drift_with_inputs(t, x)), in_axes=(None, 0))
    diffusion = system.diffusion

    def move(key: Any, t: Any, h: Any, x: Any) -> Any:
        ahead = fixed_rk4().integrate(field, t, h, 1, x)
        if diffusion is None:
            return ahead
        G = jax.vmap(lambda x: jnp.asarray(diffusion(t, x)))(x)
        s = G.shape[2]
        V = jnp.eye(s) if system.diffusion_cov is None else jnp.asarray(system.diffusion_cov, float)
        w = jnp.sqrt(h) * jax.random.normal(key, (len(x), s)) @ square_root(V).T
        return ahead + jnp.einsum("pij,pj->pi", G, w)

    return move
