"""Sums of a block count exactly the real lanes that are not lost, and nothing else gets in."""

from __future__ import annotations

import jax
import numpy as np
import pytest

from nlbench.statistics import accumulate
from nlbench.statistics.tracks import Scores
from tests.statistics import made_runs
from tests.statistics.made_runs import block_sums

LAYOUT = made_runs.layout()


def one_block(runs: int = 64, seed: int = 1, lost: float = 0.0):
    made = made_runs.make(LAYOUT, runs, seed, lost)
    return next(made_runs.blocks(made))


@pytest.mark.parametrize("rubbish", [np.nan, np.inf, 1e300, 0.0])
def test_what_a_diverged_or_padded_lane_holds_leaks_into_no_sum(rubbish):
    tracks, mask = one_block(runs=50)
    tracks.diverged[..., 7] = True
    clean = block_sums(_fill(tracks, [7, *range(50, 64)], 0.5), mask, LAYOUT)
    dirty = block_sums(_fill(tracks, [7, *range(50, 64)], rubbish), mask, LAYOUT)
    for name in clean.keys() - {"report_error", "report_variance", "report_third", "report_lost"}:
        np.testing.assert_array_equal(clean[name], dirty[name], err_msg=name)


def _fill(tracks, lanes, value):
    floats = {}
    for name in ("error", "variance", "third", "nees", "cov", "cross_third"):
        floats[name] = getattr(tracks, name).copy()
        floats[name][..., lanes] = value
    scores = []
    for array in tracks.scores:
        scores.append(array.copy())
        scores[-1][..., lanes] = value if array.dtype == float else 3
    return tracks._replace(**floats, scores=Scores(*scores))


@pytest.mark.parametrize("field", ["error", "variance", "third"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e160])
def test_a_lane_whose_powers_are_not_finite_is_lost_though_not_flagged(field, bad):
    tracks, mask = one_block()
    getattr(tracks, field)[1, 2, 0, 5] = bad
    sums = block_sums(tracks, mask, LAYOUT)
    expected = np.full((3, 4), 64)
    expected[1, 2] = 63
    np.testing.assert_array_equal(sums["alive"], expected)
    assert all(np.isfinite(sums[name]).all() for name in sums if not name.startswith("report_"))


@pytest.mark.parametrize("field", ["cov", "cross_third"])
def test_a_lane_with_a_cross_moment_that_is_not_finite_is_lost_at_that_report_time(field):
    tracks, mask = one_block()
    getattr(tracks, field)[0, 1, 1, 9] = np.nan
    sums = block_sums(tracks, mask, LAYOUT)
    assert np.argwhere(np.asarray(sums["report_lost"])).tolist() == [[0, 1, 9]]
    assert sums["alive"][0, LAYOUT.reports[1]] == 63


def test_counts_are_exact():
    tracks, mask = one_block(runs=40, lost=0.2)
    bad = made_runs.lost(made_runs.Runs(*tracks[:8], *tracks.scores), LAYOUT) | ~mask
    sums = block_sums(tracks, mask, LAYOUT)
    at_reports = bad[:, list(LAYOUT.reports)]
    assert int(sums["total"]) == 40
    np.testing.assert_array_equal(sums["alive"], (~bad).sum(-1))
    np.testing.assert_array_equal(sums["never"], (~bad.any(1)).sum(-1))
    both = [(~(at_reports[a] | at_reports[b])).sum(-1) for a, b in LAYOUT.pairs]
    np.testing.assert_array_equal(sums["pair_count"], both)
    first = [(at_reports[:, 0] & mask).sum(-1), (~at_reports[:, 0] & at_reports[:, 1]).sum(-1)]
    np.testing.assert_array_equal(sums["first_lost"], np.stack(first, axis=-1))
    np.testing.assert_array_equal(sums["guarded"], tracks.guarded[:, :40].sum(-1))
    assert (sums["updates"] == 40 * 7).all()


def test_is_traced_once_whatever_the_mask():
    traces = []

    @jax.jit
    def sums(tracks, mask):
        traces.append(1)
        return accumulate.block_sums(tracks, mask, LAYOUT)

    for runs in (64, 10, 1):
        sums(*one_block(runs))
    assert len(traces) == 1


@pytest.mark.parametrize("filters", [1, 2])
@pytest.mark.parametrize("norms", [{}, {"both": (0, 1)}])
def test_works_without_pairs_and_without_norms(filters, norms):
    layout = made_runs.layout(filters=filters, norms=norms)
    sums = block_sums(*next(made_runs.blocks(made_runs.make(layout, 64, 3))), layout)
    assert sums["pair_square"].shape == (2, filters - 1, 2, 2 + len(norms))
    assert sums["norm"].shape == (2, filters, 4, len(norms))


def test_single_precision_gives_the_same_sums_to_its_own_accuracy():
    layout = made_runs.layout(clip=(1e5, 2e5))
    tracks, mask = one_block()
    tracks = tracks._replace(
        error=tracks.error * 1e5, variance=tracks.variance * 1e10, third=tracks.third * 1e15
    )
    single = tracks._replace(
        **{name: getattr(tracks, name).astype(np.float32) for name in ("error", "variance", "third")}
    )
    double, rounded = block_sums(tracks, mask, layout), block_sums(single, mask, layout)
    for name in ("mean", "power", "clipped", "run"):
        scale = np.abs(double[name]).max()
        np.testing.assert_allclose(rounded[name], double[name], rtol=0, atol=2e-5 * scale, err_msg=name)
