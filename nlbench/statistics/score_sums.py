"""Sums over the lanes of one block, in jax, of how the filters foretold the measurements."""

from __future__ import annotations

import jax.numpy as jnp
from jaxtyping import Array, Bool

from nlbench.statistics.tracks import Scores


def score_sums(scores: Scores, alive: Bool[Array, "F T L"]) -> dict[str, Array]:
    """Sums over the lanes that are real and not lost, (F, times) with the start left out, before any measurement.

    nis: (6, F, T): runs with samples, samples c, sums a of NIS, a^2, a c, c^2; the last time is all of them together.
    left_out: (2, F, T), alike: limited or guarded, and invalid. log_likelihood: (3, F, T - 1): runs, values, squares.
    """
    never = jnp.broadcast_to(alive.all(1, keepdims=True), alive.shape)
    value = jnp.where(alive, scores.log_likelihood, jnp.nan)[:, 1:]
    finite = jnp.isfinite(value * value)
    value = jnp.where(finite, value, 0)
    left_out = jnp.stack([scores.left_out, scores.invalid])[:, :, 1:]
    here, never_lost = (jnp.where(kept[:, 1:], left_out, 0).sum(-1) for kept in (alive, never))
    return {
        "nis": jnp.concatenate([_ratio(scores, alive), _ratio(scores, never, together=True)], axis=-1),
        "left_out": jnp.concatenate([here, never_lost.sum(-1, keepdims=True)], axis=-1),
        "log_likelihood": jnp.stack(
            [finite.sum(-1).astype(value.dtype), value.sum(-1), (value * value).sum(-1)]
        ),
    }


def _ratio(scores: Scores, kept: Array, together: bool = False) -> Array:
    """What the ratio of two sums over runs, and its uncertainty, are made of."""
    a, c = (jnp.where(kept, part, 0)[:, 1:].astype(scores.nis.dtype) for part in (scores.nis, scores.samples))
    if together:
        a, c = (part.sum(1, keepdims=True) for part in (a, c))
    fit = (c > 0) & jnp.isfinite(a * a)
    a, c = (jnp.where(fit, part, 0) for part in (a, c))
    return jnp.stack([part.sum(-1) for part in (fit.astype(a.dtype), c, a, a * a, a * c, c * c)])
