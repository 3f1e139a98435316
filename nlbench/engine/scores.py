"""What the updates say of a filter: normalised innovations squared, and the likelihood of the measurements.

  (1) NIS = z' S^-1 z, of the innovation z that was foretold to have the covariance S
It is chi-square distributed with m degrees of freedom, the number of entries, where the filter is right and z normal.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
from jax.lax import optimization_barrier

from nlbench.algebra import Tensor, positive_definite, squared_distance
from nlbench.statistics.tracks import Scores

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter, UpdateInfo


class Score(NamedTuple):
    """Of one update: NIS, which is positive for a sample, 0 where nothing was measured, and -1 for what is left out;
    the logarithm of the density of what was measured."""

    nis: Any
    log_likelihood: Any


def score(filter: Filter, info: UpdateInfo) -> Score:
    """The score of one update of one trajectory.

    It is no sample where nothing was measured, which leaves an innovation of zero. It is left out where the limiter
    clipped an entry, where the guard replaced the update, and where S is not positive definite. A filter that computes
    its moments dearly, once and at the end, foretells nothing.
    """
    if filter.history is not None:
        return Score(jnp.zeros(()), jnp.full((), jnp.nan))
    z = Tensor.from_array(jnp.asarray(info.innovation))
    S = Tensor.from_array(jnp.asarray(info.innovation_cov), ((0, 1),))
    nis = squared_distance(S, z)  # (1)
    fit = positive_definite(S) & (nis < jnp.inf) & ~info.guarded
    if filter.limiter is not None:
        for r, entry in enumerate(z):
            fit &= entry * entry <= filter.limiter**2 * S[r, r]
    taken = reduce(jnp.logical_or, [entry != 0 for entry in z])
    return Score(jnp.where(taken, jnp.where(fit, nis, -1.0), 0.0), jnp.asarray(info.log_likelihood, float))


def nothing(lanes: int) -> Scores:
    """The scores (L,) before the first measurement."""
    count = jnp.zeros(lanes, int)
    return Scores(jnp.zeros(lanes), count, count, jnp.zeros(lanes))


def added(total: Scores | None, score: Score | None, due: Any = True) -> Scores | None:
    """The scores (L,) with one more update, in the lanes where it was `due`; nothing where nobody asked."""
    if total is None or score is None:
        return None
    # Without the barrier XLA forms the innovation anew in each sum.
    nis, log_likelihood = optimization_barrier((score.nis, score.log_likelihood))
    return Scores(
        nis=total.nis + jnp.where(due & (nis > 0), nis, 0),
        samples=total.samples + (due & (nis > 0)),
        left_out=total.left_out + (due & (nis < 0)),
        log_likelihood=total.log_likelihood + jnp.where(due, log_likelihood, 0),
    )


def emptied(total: Scores) -> Scores:
    """What goes on after an output: the likelihood of all measurements so far, and no sample."""
    return nothing(len(total.nis))._replace(log_likelihood=total.log_likelihood)
