"""Errors of a filter against the truth, and its own idea of them: the tracks that the statistics take.

A run has diverged by the system's rule, where an error is not finite, and, whatever the error, where the filter states
moments of it that are not finite or beyond all sense: with an index for each coordinate, and a deviation s_i,
  (1) |P_ij| > s_i s_j  or  |S_iii| > s_i^3
s_i is a thousand times the larger of the clip of |error| i and the deviation that the filter started with; without a
clip 1e12 times whatever is largest: a true state, an error, a deviation stated at the start. (1) is for good: digits
are gone, and what a measurement makes of the rest, a variance of zero for one, is luck.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, expand, positive_definite, squared_distance, zeros
from nlbench.algebra.scalarise import scalarise
from nlbench.updates.posterior import through_gain

if TYPE_CHECKING:
    from nlbench.engine.problem import Runner
    from nlbench.statistics.layout import Layout
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System

CLIPS = 1e3  # stated deviations that are beyond all sense, in units of the clip or of the start
SIZES = 1e12  # the same without a clip, in units of what is there; 1e-12 is what chance gives a fair filter


class Judged(NamedTuple):
    """Of one filter: errors (T, C, L), unique components of the estimated covariance (T, C2, L) and third moment
    (T, C3, L) of the errors, joint NEES (T, L) and whether diverged (T, L). Lists of scalars for one trajectory."""

    error: Any
    cov: Any
    third: Any
    nees: Any
    diverged: Any


def judge(
    rules: System | DiscreteSystem,
    model: System | DiscreteSystem,
    layout: Layout,
    states: Any,
    components: Any,
    senseless: Any = False,
) -> Judged:
    """Compare the true states (T, n, L) with the moments (T, k, L) that a filter gave at the same times.

    rules: the system whose rules of divergence hold. model: the filter's, which says what the errors of its state are.
    senseless: (T, L), whether it stated what is beyond all sense between the times.
    """
    # Of scalars: arrays inside would be transposed.
    each = jax.vmap(jax.vmap(lambda x, given: _one(rules, model, x, given)))
    apart = each(_apart(states), _apart(components))
    error, cov, third = (jnp.stack(part, axis=1) for part in apart[:3])
    senseless |= beyond_sense(layout, states, error, cov, third)
    diverged = apart.diverged | (jnp.cumsum(senseless, axis=0) > 0)
    return Judged(
        error, cov, third, apart.nees, _late(rules, layout, error, _lasting(rules, layout, diverged))
    )


def beyond_sense(layout: Layout, states: Any, error: Any, cov: Any, third: Any) -> Any:
    """Decide (1), at all times (T, L); of the joint third moments that are not cubes at the report times only."""
    i, j = np.array(layout.components(2)).T
    triples = np.array(layout.components(3))
    cubes, reports = (triples == triples[:, :1]).all(1), np.asarray(layout.reports)
    start = jnp.sqrt(jnp.maximum(cov[:1, i == j], 0.0))
    clip = np.asarray(layout.clip)[:, None]
    most = CLIPS * jnp.maximum(jnp.asarray(clip, cov.dtype), start)
    if not np.isfinite(clip).all():
        parts = (jnp.abs(states), jnp.abs(error), jnp.broadcast_to(start, error.shape))
        size = reduce(jnp.maximum, (part.max(1, keepdims=True) for part in parts))
        # Without any size there is nothing to compare with.
        most = jnp.where(np.isfinite(clip), most, jnp.where(size > 0, SIZES * size, jnp.inf))
    most = jnp.broadcast_to(most, error.shape)
    sound = (jnp.abs(cov) <= most[:, i] * most[:, j]).all(1)
    sound &= (jnp.abs(third[:, cubes]) <= most**3).all(1)
    joint = jnp.abs(third[reports]) <= most[reports][:, triples].prod(2)
    return ~sound.at[reports].set(sound[reports] & joint.all(1))


def most_stated(layout: Layout, runner: Runner) -> np.ndarray | None:
    """The deviations (n,) of (1) for the states of a filter; None where they are not those of the errors, where there
    are no clips, and for filters that draw or remember, to which stating a covariance is dear."""
    filter = runner.filter
    own = filter.system.error is not None or filter.random or filter.history is not None
    if own or not np.isfinite(layout.clip).any():
        return None
    start = np.sqrt(np.maximum(np.diagonal(np.asarray(runner.initial.cov, float)), 0.0))
    return CLIPS * np.maximum(layout.clip, start)


def _apart(array: Any) -> list[Any]:
    return [array[:, place] for place in range(array.shape[1])]


def _one(
    rules: System | DiscreteSystem, model: System | DiscreteSystem, x: list[Any], given: list[Any]
) -> Judged:
    """One trajectory at one time: n states, k components."""
    mean, cov, third = _parted(given, model.states)
    error, cov, third = _errors(model, x, mean, cov, third)
    distance = squared_distance(cov, error)
    lost = ~reduce(jnp.logical_and, map(jnp.isfinite, error))
    if rules.diverged is not None:
        ((_, (rule,)),) = scalarise(rules.diverged, list(error), dtype=float)
        lost = lost | rule
    nees = jnp.where(positive_definite(cov), distance, jnp.nan)
    parts = [list(map(jnp.asarray, tensor)) for tensor in (error, cov, third)]
    return Judged(parts[0], parts[1], parts[2], nees, lost)


def _parted(given: list[Any], n: int) -> tuple[Tensor, Tensor, Tensor]:
    """The components that `follow` joined; a filter without third moments has zero ones."""
    entries = iter(given)
    mean, cov = (Tensor.symmetric(n, order, lambda _: next(entries)) for order in (1, 2))
    carried = len(given) > n + n * (n + 1) // 2
    third = Tensor.symmetric(n, 3, lambda _: next(entries)) if carried else zeros(n, 3)
    return mean, cov, third


def _errors(
    system: System | DiscreteSystem, x: list[Any], mean: Tensor, cov: Tensor, third: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """The error and its estimated moments; through the Jacobian where the system has its own errors."""
    if system.error is None:
        return Tensor.symmetric(len(x), 1, lambda i: x[i[0]]) - mean, cov, third
    own = system.error
    about = expand(lambda t, m: own(jnp.stack(x), m), 0.0, list(mean), 1)
    assert about.first is not None
    J = -about.first
    return about.value, through_gain(J, cov), through_gain(J, third)


def _lasting(system: System | DiscreteSystem, layout: Layout, diverged: Any) -> Any:
    """Where the rule says so, a run that has diverged at a report time stays diverged."""
    if not system.diverged_stays:
        return diverged
    reported = jnp.zeros(len(layout.times), bool).at[jnp.asarray(layout.reports)].set(True)
    return diverged | (jnp.cumsum(diverged & reported[:, None], axis=0) > 0)


def _late(rules: System | DiscreteSystem, layout: Layout, error: Any, diverged: Any) -> Any:
    """A run whose errors were large over the last part of it has diverged at its end."""
    late = rules.diverged_late
    if late is None:
        return diverged
    times = np.asarray(layout.times)
    window = times > times[-1] - late.window
    square = sum(error[window, member] ** 2 for member in late.members)
    return diverged.at[-1].set(diverged[-1] | (jnp.sqrt(square.mean(0)) > late.bound))
