"""The Gaussian sum filter: a bank of extended Kalman or second-order filters, each with a weight.

The prior is laid out as a sum of narrower Gaussians (`mixture`), so that f and h are nearly straight within each. Each
follows its own filter, `linearised` or `second_order`, and at a measurement
  (1) log w_i += log N(z_i; 0, S_i), normalised
after which Gaussians that have become alike, or that hardly count, are joined, the cheapest first; and where one
Gaussian carries more than the share `renew` of the weight, the sum's mean and covariance are laid out anew. Posterior:
a sum of Gaussians, with exact mean and covariance. Cost: components^n filters, and their square at an update.
Sources: Alspach and Sorenson 1972, IEEE Trans. Automatic Control 17, 439-448; Runnalls 2007, IEEE Trans. Aerospace
and Electronic Systems 43, 989-999 (joining). Fails when noise makes each Gaussian wide while several share the weight.
A member that leaves the finite numbers loses its weight. A linear system needs one member, which is then exact, and
gets no more.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench.discrete import linearised, second_order
from nlbench.discrete.correction import Gaussian, Spread, symmetric
from nlbench.discrete.gaussian import approximated, components, gaussian
from nlbench.discrete.mixture import Mixture, joined, laid_out, overall, renewed
from nlbench.discrete.problem import bends, observation, transition
from nlbench.discrete.propagation import moment_rates, propagator
from nlbench.discrete.roots import square_root
from nlbench.discrete.time import Clock
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.moments import Moments
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    from nlbench.row import Row
    from nlbench.systems.system import System

MOST = 1000  # Gaussians
NEEDED = 1430  # bytes for a pair of them in a block of 64 runs, as XLA states it


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """A bank of `options.bank`, `options.components` per dimension; of one where the system is linear."""
    count = options.components if bends(system, options) else 1
    step, local, update = linearised.step, linearised.local, linearised.update
    if options.bank == "sof-gaussian":
        step, local, update = (
            partial(function, True)
            for function in (second_order.step, second_order.local, second_order.update)
        )
    seen = observation(system, options)
    _refuse_too_many(name, count, system.states)

    if isinstance(system, DiscreteSystem):
        motion = transition(system)
        clock = Clock.of_steps(lambda state, k: _each(lambda prior: step(motion, k, prior), state))
    else:
        around = approximated(local, system)
        advance = propagator(around, options.propagation)
        clock = Clock.of_integrals(
            lambda state, t, h, count: _each(lambda prior: advance(prior, t, h, count), state),
            options.step or system.default_step,
        )

    def updated(
        state: Mixture, t: Any, y: Any, key: Any = None, sighting: Any = None
    ) -> tuple[Mixture, UpdateInfo]:
        sighted = seen if sighting is None else observation(system.sighted(sighting), options)
        posterior, info = _updated(partial(update, sighted), state, t, jnp.asarray(y))
        return renewed(joined(posterior, options.merge), count, options.spread, options.renew), info

    def whole(state: Mixture) -> Gaussian:
        return overall(jnp.exp(state.log_weights), state.each)

    def rates(state: Mixture, t: Any, y: Any = None) -> Moments:
        if clock.discrete:
            raise ConfigError(f"{name}: moments have no time derivatives where time is discrete")
        held = lambda each: whole(state._replace(each=each))  # noqa: E731
        slope = jax.vmap(lambda each: moment_rates(around, t, each, square_root(each.cov)))(state.each)
        return Moments(*jax.jvp(held, (state.each,), (slope,))[1])

    sightings = getattr(system, "sightings", None)
    return Filter(
        name=name,
        system=system,
        init=lambda moments, key=None: laid_out(gaussian(moments), count, options.spread),
        predict=lambda state, t0, t1, key=None: clock.predict(state, t0, t1),
        update=updated,
        moments=lambda state: Moments(*whole(state)),
        rates=rates,
        integrate=clock.integrate,
        components=lambda state: components(whole(state)),
        angle=(lambda state: sightings.angle(whole(state).mean)) if sightings else None,
    )


def _refuse_too_many(name: str, count: int, n: int) -> None:
    """Raises `ConfigError` for more Gaussians than can be compared with each other."""
    if count**n <= MOST:
        return
    fewer = max(each for each in range(1, count) if each**n <= MOST)
    remedy = (
        f"components: {fewer} gives {fewer**n:,}"
        if fewer > 1
        else "ukf and ensemble take systems of this size"
    )
    raise ConfigError(
        f"{name}.components: {count} along each of {n} states are {count**n:,} Gaussians; to be joined each is "
        f"compared with every other, which takes {NEEDED * count ** (2 * n) / 1e9:,.3g} GB a block of 64 runs, so that "
        f"{MOST:,} are the most; {remedy}"
    )


def _each(move: Callable[[Spread], Spread], state: Mixture) -> Mixture:
    """The mixture whose Gaussians have all moved."""
    return state._replace(each=jax.vmap(lambda each: _covered(move(_rooted(each))))(state.each))


def _rooted(each: Gaussian) -> Spread:
    return Spread(each.mean, square_root(each.cov))


def _covered(each: Spread) -> Gaussian:
    return Gaussian(each.mean, symmetric(each.cov))


def _updated(update: Callable, prior: Mixture, t: Any, y: Any) -> tuple[Mixture, UpdateInfo]:
    """(1)."""

    def one(each: Gaussian) -> tuple[Gaussian, UpdateInfo]:
        posterior, info = update(t, _rooted(each), y)
        return _covered(posterior), info

    each, info = jax.vmap(one)(prior.each)
    gained = prior.log_weights + info.log_likelihood  # (1)
    lost = jnp.isnan(gained)
    gained = jnp.where(lost & ~jnp.all(lost), -jnp.inf, gained)
    heaviest = jnp.argmax(jnp.where(lost, -jnp.inf, gained))
    each = jax.tree.map(
        lambda part: jnp.where(lost.reshape(-1, *[1] * (part.ndim - 1)), part[heaviest], part), each
    )
    total = jax.nn.logsumexp(gained)
    # What no member thought possible says nothing of their weights.
    posterior = Mixture(jnp.where(total == -jnp.inf, prior.log_weights, gained - total), each)
    w = jnp.exp(prior.log_weights)
    z = overall(
        jnp.where(lost, 0.0, w),
        Gaussian(_without(lost, info.innovation), _without(lost, info.innovation_cov)),
    )
    return posterior, UpdateInfo(
        innovation=z.mean,
        innovation_cov=z.cov,
        log_likelihood=total,
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )


def _without(lost: Any, values: Any) -> Any:
    """Values (p, ...) with zeros where a member is lost."""
    return jnp.where(lost.reshape(-1, *[1] * (values.ndim - 1)), 0.0, values)
