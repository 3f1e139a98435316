"""What the updates say of a filter: normalised innovations squared, and the likelihood of the measurements.

  (1) NIS = z' S^-1 z, of the innovation z that was foretold to have the covariance S
It is chi-square distributed with m degrees of freedom, the number of entries, where the filter is right and z normal.
A residual of 1e12 stated deviations is none of the filter's: its mean was lost on the way.
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


MOST = 1e24  # of NIS
ALTERED, INVALID = -1.0, -2.0  # what stands for NIS where there is none


class Score(NamedTuple):
    """Of one update: NIS, which is positive for a sample, 0 where nothing was measured, and `ALTERED` or `INVALID` for
    what is left out; the logarithm of the density of what was measured."""

    nis: Any
    log_likelihood: Any


def score(filter: Filter, info: UpdateInfo) -> Score:
    """The score of one update of one trajectory.

    It is no sample where nothing was measured, which leaves an innovation of zero. It is left out as altered where the
    limiter clipped an entry and where the guard replaced the update; as invalid where z or S is not finite, S is not
    positive definite or NIS is beyond `MOST`. A filter that computes its moments dearly, once and at the end, foretells
    nothing.
    """
    if filter.history is not None:
        return Score(jnp.zeros(()), jnp.full((), jnp.nan))
    z = Tensor.from_array(jnp.asarray(info.innovation))
    S = Tensor.from_array(jnp.asarray(info.innovation_cov), ((0, 1),))
    nis = squared_distance(S, z)  # (1)
    valid, altered = positive_definite(S) & (nis < MOST), info.guarded
    for r, entry in enumerate(z):
        valid &= S[r, r] < jnp.inf
        if filter.limiter is not None:
            altered |= entry * entry > filter.limiter**2 * S[r, r]
    taken = reduce(jnp.logical_or, [entry != 0 for entry in z])
    found = jnp.where(valid, jnp.where(altered, ALTERED, nis), INVALID)
    # A density of such a residual would be all that is left of the sum.
    log_likelihood = jnp.where(nis >= MOST, jnp.nan, jnp.asarray(info.log_likelihood, float))
    return Score(jnp.where(taken, found, 0.0), log_likelihood)


def nothing(lanes: int) -> Scores:
    """The scores (L,) before the first measurement."""
    count = jnp.zeros(lanes, int)
    return Scores(jnp.zeros(lanes), count, count, jnp.zeros(lanes), count)


def added(total: Scores | None, score: Score | None, due: Any = True) -> Scores | None:
    """The scores (L,) with one more update, in the lanes where it was `due`; nothing where nobody asked."""
    if total is None or score is None:
        return None
    # Without the barrier XLA forms the innovation anew in each sum.
    nis, log_likelihood = optimization_barrier((score.nis, score.log_likelihood))
    return Scores(
        nis=total.nis + jnp.where(due & (nis > 0), nis, 0),
        samples=total.samples + (due & (nis > 0)),
        left_out=total.left_out + (due & (nis == ALTERED)),
        log_likelihood=total.log_likelihood + jnp.where(due, log_likelihood, 0),
        invalid=total.invalid + (due & (nis == INVALID)),
    )


def emptied(total: Scores) -> Scores:
    """What goes on after an output: the likelihood of all measurements so far, and no sample."""
    return nothing(len(total.nis))._replace(log_likelihood=total.log_likelihood)
