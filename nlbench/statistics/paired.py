"""Differences between filters on the same runs, at the report times.

`rms` and `mean_error` are over the runs in which neither filter is lost, `rms_clipped` over all runs.
Standard errors: jackknife if enough groups are filled; otherwise the delta method by each run's influence,
since the errors of all runs are then at hand.
"""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from nlbench.statistics.ieee import ieee
from nlbench.statistics.kept import magnitudes
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import JACKKNIFE_GROUPS, Sums, jackknife, p_value

COLUMNS = ("filter_a", "filter_b", "time", "coordinate", "statistic", "difference", "stderr", "n", "p_value")
STATISTICS = ("rms", "rms_clipped", "mean_error")


@ieee
def paired_table(totals: Totals) -> pd.DataFrame:
    """A row for each pair of filters (in file order), report time, magnitude and statistic: a minus b."""
    layout = totals.layout
    if not layout.pairs:
        return pd.DataFrame({column: [] for column in COLUMNS})
    computed = {name: _difference(totals, name) for name in STATISTICS}
    if totals.filled_groups < JACKKNIFE_GROUPS and totals.all_kept:
        stderrs = _influence_stderrs(totals)
        computed = {name: (value, stderrs[name], n) for name, (value, _, n) in computed.items()}
    rows = []
    for pair, (a, b) in enumerate(layout.pairs):
        for r, time in enumerate(layout.report_times):
            for m, coordinate in enumerate(layout.magnitudes):
                for name, (value, stderr, n) in computed.items():
                    if m < value.shape[-1]:
                        here = pair, r, m
                        d, s = float(value[here]), float(stderr[here])
                        names = layout.filters[a], layout.filters[b], time, coordinate, name
                        rows.append((*names, d, s, int(n[here]), p_value(d, s)))
    return pd.DataFrame(rows, columns=COLUMNS)


def _difference(totals: Totals, statistic: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Difference, jackknife standard error and number of runs, (pairs, reports, magnitudes)."""
    layout, groups = totals.layout, totals.groups
    a, b = np.array(layout.pairs).T
    scale = np.array(layout.scale)
    both = groups["pair_count"][..., None].astype(np.float64)
    if statistic == "mean_error":
        sums = {"n": both, "difference": groups["pair_mean"]}
        scale = scale[: len(layout.coordinates)]
    elif statistic == "rms":
        sums = {"n": both, "a": groups["pair_square"][:, 0], "b": groups["pair_square"][:, 1]}
    else:
        clipped = groups["clipped"][:, 0][:, :, list(layout.reports)]
        runs = np.broadcast_to(groups["total"][:, None, None, None], both.shape)
        sums = {"n": runs, "a": clipped[:, a], "b": clipped[:, b]}

    def value_of(part: Sums) -> np.ndarray:
        if "difference" in part:
            return scale * (part["difference"] / part["n"])
        return scale * (
            np.sqrt(np.maximum(part["a"], 0) / part["n"]) - np.sqrt(np.maximum(part["b"], 0) / part["n"])
        )

    value = value_of({name: part.sum(0) for name, part in sums.items()})
    weight = np.broadcast_to(sums["n"], (len(both), *value.shape))
    return value, jackknife(value_of, sums, weight), weight.sum(0)


def _influence_stderrs(totals: Totals) -> dict[str, np.ndarray]:
    """Delta method: a run's influence on a root mean square is its square over twice the root."""
    layout = totals.layout
    shape = (len(layout.pairs), len(layout.reports), len(layout.magnitudes))
    stderrs = {name: np.full(shape, np.nan) for name in STATISTICS}
    for pair, r, name, influence in _influences(totals):
        if influence.shape[-1] > 1:
            stderr = influence.std(axis=-1) / np.sqrt(influence.shape[-1] - 1)
            stderrs[name][pair, r, : len(stderr)] = stderr
    return stderrs


def _influences(totals: Totals) -> Iterator[tuple[int, int, str, np.ndarray]]:
    """Every run's influence (magnitudes, runs) on each paired statistic."""
    layout, kept = totals.layout, totals.kept
    squares = magnitudes(kept.error, layout) ** 2
    clip = np.array(layout.magnitude_clip)[:, None] ** 2
    clipped = np.where(kept.lost[:, :, None], clip, np.minimum(squares, clip))
    for pair, (a, b) in enumerate(layout.pairs):
        for r in range(len(layout.reports)):
            both = ~(kept.lost[a, r] | kept.lost[b, r])
            yield pair, r, "rms", _rms_influence(squares[a, r][:, both], squares[b, r][:, both])
            yield pair, r, "rms_clipped", _rms_influence(clipped[a, r], clipped[b, r])
            yield pair, r, "mean_error", (kept.error[a, r] - kept.error[b, r])[:, both]


def _rms_influence(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    if a.shape[-1] == 0:
        return np.zeros_like(a)
    halves = [square / (2 * np.sqrt(square.mean(-1, keepdims=True))) for square in (a, b)]
    return halves[0] - halves[1]
