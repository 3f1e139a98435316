"""Errors of a filter against the truth, and its own idea of them: the tracks that the statistics take."""

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
    from nlbench.statistics.layout import Layout
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


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
) -> Judged:
    """Compare the true states (T, n, L) with the moments (T, k, L) that a filter gave at the same times.

    rules: the system whose rules of divergence hold. model: the filter's, which says what the errors of its state are.
    """
    # Of scalars: arrays inside would be transposed.
    each = jax.vmap(jax.vmap(lambda x, given: _one(rules, model, x, given)))
    apart = each(_apart(states), _apart(components))
    error, cov, third = (jnp.stack(part, axis=1) for part in apart[:3])
    return Judged(
        error, cov, third, apart.nees, _late(rules, layout, error, _lasting(rules, layout, apart.diverged))
    )


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
