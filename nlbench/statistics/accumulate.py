"""Sums over the lanes of one block, in jax, of everything that the tables are made of.

A lane is *lost* for a filter at a time when it has diverged, or when an estimate or a power of the error that
is summed is not finite. Lost and padded lanes are replaced before any sum, so nothing leaks from them. Errors
are in units of `Layout.scale`. Power sums are about the block's own mean, which the totals move to a common
pivot: a mean that is large against the standard deviation costs no digits. Error,
variance and third are summed one by one: stacking them first made this ten times slower.
"""

import jax.numpy as jnp
import numpy as np
from jax.lax import optimization_barrier
from jaxtyping import Array, Bool

from nlbench.statistics.layout import Layout
from nlbench.statistics.score_sums import score_sums
from nlbench.statistics.tracks import Tracks
from nlbench.statistics.uncertainty import NORMAL_975


def block_sums(tracks: Tracks, mask: Bool[Array, " L"], layout: Layout) -> dict[str, Array]:
    """All sums of a block; `mask` is true for real lanes, which come first. The layout decides the shapes."""
    reports = np.asarray(layout.reports, int)
    scale = jnp.asarray(layout.scale[: len(layout.coordinates)], tracks.error.dtype)[:, None]
    # Without the barrier XLA divides anew in every sum.
    error, variance, third = optimization_barrier(
        (tracks.error / scale, tracks.variance / scale**2, tracks.third / scale**3)
    )
    lost = optimization_barrier(_lost(tracks, error, variance, third, reports))
    alive = mask & ~lost
    squares = (error * error, _norm_squares(tracks.error, layout))
    at_reports = (squares[0][:, reports], squares[1][:, reports])
    pointwise = _pointwise(error, variance, third, alive)
    deviation = _deviation(error[:, reports], pointwise["mean"][0][:, reports], alive[:, reports])
    return {
        "total": mask.sum(),
        "alive": alive.sum(-1),
        **pointwise,
        **_magnitudes(squares, mask, lost, layout),
        **_consistency(error, variance, tracks.nees, alive),
        **_cross(deviation, tracks, alive[:, reports], layout),
        **_pairs(error[:, reports], at_reports, alive[:, reports], layout),
        **_divergence(lost[:, reports], mask, tracks),
        **({} if tracks.scores is None else score_sums(tracks.scores, alive)),
        "report_error": tracks.error[:, reports],
        "report_variance": tracks.variance[:, reports].astype(jnp.float32),
        "report_third": tracks.third[:, reports].astype(jnp.float32),
        "report_lost": lost[:, reports],
    }


def _lost(tracks: Tracks, error: Array, variance: Array, third: Array, reports: np.ndarray) -> Array:
    finite = jnp.isfinite(error**6) & jnp.isfinite(variance**2) & jnp.isfinite(third**2)
    lost = tracks.diverged | ~finite.all(2)
    joint = jnp.isfinite(tracks.cov).all(2) & jnp.isfinite(tracks.cross_third).all(2)
    return lost.at[:, reports].set(lost[:, reports] | ~joint)


def _norm_squares(error: Array, layout: Layout) -> Array:
    """Squares of the named norms, each in its own scale."""
    scales = layout.scale[len(layout.coordinates) :]
    squares = [
        sum((error[:, :, i] / scale) ** 2 for i in members)
        for members, scale in zip(layout.norms.values(), scales, strict=True)
    ]
    filters, times, _, lanes = error.shape
    return jnp.stack(squares, axis=2) if squares else jnp.zeros((filters, times, 0, lanes), error.dtype)


def _deviation(value: Array, mean: Array, alive: Array) -> Array:
    return jnp.where(alive[:, :, None], value - mean[..., None], 0)


def _pointwise(error: Array, variance: Array, third: Array, alive: Array) -> dict[str, Array]:
    """Block means of error, variance and third; sums of powers 2 to 6 and 2 of the deviations from them."""
    count = jnp.maximum(alive.sum(-1), 1)[..., None]
    values = (error, variance, third)
    means = [jnp.where(alive[:, :, None], value, 0).sum(-1) / count for value in values]
    d, dv, ds = (_deviation(value, mean, alive) for value, mean in zip(values, means, strict=True))
    d2 = d * d
    d3 = d2 * d
    return {
        "mean": jnp.stack(means),
        "power": jnp.stack([power.sum(-1) for power in (d2, d3, d2 * d2, d2 * d3, d3 * d3)]),
        "spread": jnp.stack([(dv * dv).sum(-1), (ds * ds).sum(-1)]),
    }


def _magnitudes(squares: tuple[Array, Array], mask: Array, lost: Array, layout: Layout) -> dict[str, Array]:
    """Sums of clipped squares (all runs), of the norms, and of every run's mean square over time."""
    coordinates = len(layout.coordinates)
    bounds = jnp.asarray([c / s for c, s in zip(layout.magnitude_clip, layout.scale, strict=True)])
    limits = (bounds**2).astype(squares[0].dtype)[:, None]
    alive = (mask & ~lost)[:, :, None]
    never = mask & ~lost.any(1)
    clipped, runs = [], []
    for square, limit in zip(squares, (limits[:coordinates], limits[coordinates:]), strict=True):
        capped = jnp.where(lost[:, :, None], limit, jnp.minimum(square, limit))
        capped = jnp.where(mask, capped, 0)
        clipped.append(jnp.stack([capped.sum(-1), (capped * capped).sum(-1)]))
        after_start = square[:, 1:] if square.shape[1] > 1 else square
        run = jnp.where(never[:, None], after_start.mean(1), 0)
        runs.append(jnp.stack([run.sum(-1), (run * run).sum(-1), jnp.sqrt(run).sum(-1)]))
    norm = jnp.where(alive, squares[1], 0)
    return {
        "clipped": jnp.concatenate(clipped, axis=-1),
        "norm": jnp.stack([norm.sum(-1), (norm * norm).sum(-1)]),
        "never": never.sum(-1),
        "run": jnp.concatenate(runs, axis=-1),
    }


def _consistency(error: Array, variance: Array, nees: Array, alive: Array) -> dict[str, Array]:
    """Squared errors against the estimated variance, per coordinate and (last) jointly."""
    alive = alive[:, :, None]
    square = error * error
    joined = []
    for value in (square / jnp.where(variance > 0, variance, jnp.nan), nees[:, :, None]):
        counted = alive & jnp.isfinite(value * value)
        kept = jnp.where(counted, value, 0)
        joined.append(jnp.stack([counted.sum(-1).astype(kept.dtype), kept.sum(-1), (kept * kept).sum(-1)]))
    inside = alive & (square <= NORMAL_975**2 * variance)
    return {"nees": jnp.concatenate(joined, axis=-1), "covered": inside.sum(-1)}


def _cross(deviation: Array, tracks: Tracks, alive: Array, layout: Layout) -> dict[str, Array]:
    """Joint second and third moments at the report times: actual about the block mean, and estimated."""
    i, j = np.array(layout.components(2)).T
    k, m, n = np.array(layout.components(3)).T
    keep = alive[:, :, None]
    return {
        "cross_second": (deviation[:, :, i] * deviation[:, :, j]).sum(-1),
        "cross_third": (deviation[:, :, k] * deviation[:, :, m] * deviation[:, :, n]).sum(-1),
        "estimated_second": jnp.where(keep, tracks.cov, 0).sum(-1),
        "estimated_third": jnp.where(keep, tracks.cross_third, 0).sum(-1),
    }


def _pairs(error: Array, squares: tuple[Array, Array], alive: Array, layout: Layout) -> dict[str, Array]:
    """Sums over the lanes in which neither filter of a pair is lost, at the report times."""
    a, b = np.array(layout.pairs, int).reshape(-1, 2).T
    both = alive[a] & alive[b]
    keep = both[:, :, None]
    sides = [[jnp.where(keep, square[side], 0).sum(-1) for square in squares] for side in (a, b)]
    return {
        "pair_count": both.sum(-1),
        "pair_square": jnp.stack([jnp.concatenate(side, axis=-1) for side in sides]),
        "pair_mean": jnp.where(keep, error[a] - error[b], 0).sum(-1),
    }


def _divergence(lost: Array, mask: Array, tracks: Tracks) -> dict[str, Array]:
    """How many runs are lost for the first time at each report time, and how often the guard fired."""
    flagged = lost & mask
    before = jnp.cumsum(flagged, axis=1) - flagged
    return {
        "first_lost": (flagged & (before == 0)).sum(-1),
        "guarded": jnp.where(mask, tracks.guarded, 0).sum(-1),
        "updates": jnp.where(mask, tracks.updates, 0).sum(-1),
    }
