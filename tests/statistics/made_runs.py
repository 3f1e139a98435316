"""Invented runs, cut into blocks as the engine does, and the statistics of them all at once in plain NumPy.

The oracle works on whole arrays (filters, times, coordinates, runs) and shares no formula with the package's
sums; only the layout's names are used.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from nlbench.statistics import accumulate
from nlbench.statistics.layout import Layout
from nlbench.statistics.totals import Totals
from nlbench.statistics.tracks import Scores, Tracks

LANES = 64


class Runs(NamedTuple):
    """The fields of `Tracks`, for all runs; then those of its scores."""

    error: np.ndarray
    variance: np.ndarray
    third: np.ndarray
    nees: np.ndarray
    cov: np.ndarray
    cross_third: np.ndarray
    diverged: np.ndarray
    guarded: np.ndarray
    nis: np.ndarray
    samples: np.ndarray
    left_out: np.ndarray
    log_likelihood: np.ndarray
    invalid: np.ndarray


def layout(
    filters: int = 3,
    times: int = 4,
    clip: tuple[float, ...] = (1.5, 2.0),
    keep_runs: int = 20_000,
    norms: dict[str, tuple[int, ...]] | None = None,
) -> Layout:
    """Reports are the second and the last time; the norm `both` is over the first two coordinates."""
    names = ("position", "velocity", "damping")[: len(clip)]
    default = {"both": (0, 1)} if len(clip) > 1 else {}
    return Layout(
        filters=tuple(f"filter {i + 1}" for i in range(filters)),
        times=tuple(np.round(0.5 * np.arange(times), 12).tolist()),
        reports=(1, times - 1),
        coordinates=names,
        units=("m", "m/s", "")[: len(clip)],
        clip=clip,
        norms=default if norms is None else norms,
        keep_runs=keep_runs,
    )


def make(layout: Layout, runs: int, seed: int, lost: float = 0.02) -> Runs:
    """Skewed errors that filters share in part; some runs diverge, some hold NaN or infinity unflagged.

    Up to three measurements of two entries come between outputs, and some runs lose their likelihood on the way.
    """
    rng = np.random.default_rng(seed)
    f, t, c = len(layout.filters), len(layout.times), len(layout.coordinates)
    r, n = len(layout.reports), runs
    mixing = np.eye(c) + 0.3
    common, own = rng.normal(size=(1, t, c, n)), rng.normal(size=(f, t, c, n))
    raw = np.einsum("ij,ftjn->ftin", mixing, common + 0.5 * own)
    error = 0.2 + 0.5 * raw + 0.1 * raw**2
    variance = rng.uniform(0.3, 1.0, (f, t, c, n))
    samples = rng.integers(0, 4, (f, t, n)) * (np.arange(t) > 0)[:, None]
    gained = np.where(rng.random((f, t, n)) < 0.01, np.nan, rng.normal(-2.0, 1.0, (f, t, n)))
    runs_made = Runs(
        error=error,
        variance=np.where(rng.random(variance.shape) < 0.01, -variance, variance),
        third=rng.normal(size=(f, t, c, n)),
        nees=np.where(rng.random((f, t, n)) < 0.05, np.nan, rng.chisquare(c, (f, t, n))),
        cov=rng.normal(size=(f, r, len(layout.components(2)), n)),
        cross_third=rng.normal(size=(f, r, len(layout.components(3)), n)),
        diverged=rng.random((f, t, n)) < lost,
        guarded=rng.integers(0, 3, (f, n)),
        nis=np.where(samples > 0, rng.chisquare(np.maximum(2 * samples, 1)), 0.0),
        samples=samples,
        left_out=rng.binomial(1, 0.1, (f, t, n)) * (np.arange(t) > 0)[:, None],
        log_likelihood=np.cumsum(np.where((np.arange(t) > 0)[:, None], gained, 0.0), axis=1),
        invalid=rng.binomial(1, 0.05, (f, t, n)) * (np.arange(t) > 0)[:, None],
    )
    for field, bad in (("error", np.nan), ("variance", np.inf), ("third", -np.inf), ("cov", np.nan)):
        array = getattr(runs_made, field)
        array[rng.random(array.shape) < lost / 10] = bad
    return runs_made


def blocks(runs: Runs, updates: int = 7):
    """Pairs of tracks and mask; the last block is padded with rubbish."""
    count = runs.error.shape[-1]
    for start in range(0, count, LANES):
        real = min(LANES, count - start)
        parts = []
        for array in runs:
            part = array[..., start : start + real]
            rubbish = np.full((*part.shape[:-1], LANES - real), np.nan if part.dtype == float else 1)
            parts.append(np.concatenate([part, rubbish.astype(part.dtype)], axis=-1))
        tracks, scores = parts[:8], Scores(*parts[8:])
        yield Tracks(*tracks, np.full(tracks[-1].shape, updates), scores), np.arange(LANES) < real


_COMPILED: dict[str, Callable] = {}


def block_sums(tracks: Tracks, mask: np.ndarray, layout: Layout) -> dict[str, jax.Array]:
    """The sums of a block, compiled once for each layout."""
    if repr(layout) not in _COMPILED:
        _COMPILED[repr(layout)] = jax.jit(lambda *block: accumulate.block_sums(*block, layout))
    return _COMPILED[repr(layout)](tracks, mask)


def stacked(sums: list[dict]) -> dict[str, np.ndarray]:
    """Sums of several blocks along a leading axis, as the engine hands them over."""
    return {name: np.stack([np.asarray(block[name]) for block in sums]) for name in sums[0]}


def total(runs: Runs, layout: Layout) -> Totals:
    """Totals over all blocks."""
    totals = Totals(layout)
    for number, block in enumerate(blocks(runs)):
        totals.add(number, stacked([block_sums(*block, layout)]))
    return totals


def lost(runs: Runs, layout: Layout) -> np.ndarray:
    """(filters, times, runs): flagged, or something is not finite."""
    bad = runs.diverged.copy()
    for array in (runs.error, runs.variance, runs.third):
        bad |= ~np.isfinite(array).all(axis=2)
    for array in (runs.cov, runs.cross_third):
        bad[:, list(layout.reports)] |= ~np.isfinite(array).all(axis=2)
    return bad


def magnitude(runs: Runs, layout: Layout, f: int, t: int, name: str) -> np.ndarray:
    """|error| of a coordinate or a norm in every run."""
    members = layout.norms.get(name) or (layout.coordinates.index(name),)
    return np.sqrt(sum(runs.error[f, t, i] ** 2 for i in members))


def clip(layout: Layout, name: str) -> float:
    members = layout.norms.get(name) or (layout.coordinates.index(name),)
    return float(np.sqrt(sum(layout.clip[i] ** 2 for i in members)))


def statistics(runs: Runs, layout: Layout) -> dict[tuple[str, str, str, str], tuple[float, int]]:
    """Value and n of every row of the table `statistics`, by filter, time, coordinate and statistic."""
    bad = lost(runs, layout)
    rows = {}
    for (f, label), (t, time) in itertools.product(enumerate(layout.filters), enumerate(layout.times)):
        good = ~bad[f, t]
        at = label, repr(time)
        rows[(*at, "all", "diverged")] = bad[f, t].mean(), len(good)
        if t > 0:
            rows |= scores(runs, at, f, [t], good)
            likelihood = runs.log_likelihood[f, t, good & np.isfinite(runs.log_likelihood[f, t])]
            rows[(*at, "all", "log_likelihood")] = likelihood.mean(), len(likelihood)
        joint = runs.nees[f, t][good & np.isfinite(runs.nees[f, t])]
        rows[(*at, "all", "nees")] = joint.mean(), len(joint)
        for name in layout.magnitudes:
            size = magnitude(runs, layout, f, t, name)
            capped = np.where(bad[f, t], clip(layout, name), np.minimum(size, clip(layout, name)))
            rows[(*at, name, "rms")] = np.sqrt(np.mean(size[good] ** 2)), good.sum()
            rows[(*at, name, "rms_clipped")] = np.sqrt(np.mean(capped**2)), len(good)
            if t in layout.reports:
                rows[(*at, name, "median_error")] = np.median(np.where(good, size, np.inf)), len(good)
        for c, name in enumerate(layout.coordinates):
            e, v, s = (array[f, t, c, good] for array in (runs.error, runs.variance, runs.third))
            positive = v > 0
            values = {
                "mean_error": e.mean(),
                "variance_estimated": v.mean(),
                "variance_actual": e.var(),
                "third_estimated": s.mean(),
                "third_actual": np.mean((e - e.mean()) ** 3),
                "coverage_95": np.mean(positive & (np.abs(e) <= 1.959964 * np.sqrt(np.abs(v)))),
            }
            rows |= {(*at, name, statistic): (value, good.sum()) for statistic, value in values.items()}
            rows[(*at, name, "nees")] = np.mean(e[positive] ** 2 / v[positive]), positive.sum()
    for f, label in enumerate(layout.filters):
        never = ~bad[f].any(axis=0)
        rows |= scores(runs, (label, "all"), f, range(1, len(layout.times)), never)
        for name in layout.magnitudes:
            sizes = np.stack(
                [magnitude(runs, layout, f, t, name)[never] for t in range(1, len(layout.times))]
            )
            rows[label, "all", name, "rms"] = np.sqrt(np.mean(sizes**2)), never.sum()
            rows[label, "all", name, "rms_run_mean"] = (
                np.mean(np.sqrt(np.mean(sizes**2, axis=0))),
                never.sum(),
            )
    return rows


def scores(runs: Runs, at: tuple[str, str], f: int, times, chosen: np.ndarray) -> dict:
    """The mean over all samples of the chosen runs at these times."""
    count = runs.samples[f, list(times)][:, chosen].sum()
    return {(*at, "all", "nis"): (runs.nis[f, list(times)][:, chosen].sum() / count, count)}


def keyed(table) -> dict:
    """The rows of the table `statistics` by filter, time, coordinate and statistic."""
    return {(row.filter, row.time, row.coordinate, row.statistic): row for row in table.itertuples()}
