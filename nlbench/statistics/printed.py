"""Moments that a source prints, means over its few runs, against those of many runs.

The question is whether a printed number could come from so few runs of this experiment. For an actual moment the answer
is the share of sets of as many kept runs whose moment is as far out, in either direction; for an estimated one the
standard error over many runs, scaled to so few. Agreement of numbers that scatter so much says little;
disagreement says a lot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pandas as pd

from nlbench.statistics.claim import Claim
from nlbench.statistics.comparisons import Comparison
from nlbench.statistics.sets import KeptTable
from nlbench.statistics.uncertainty import p_value

SETS = 20_000  # resolve p-values down to Holm's for a hundred numbers


class Judged(NamedTuple):
    """Printed minus measured, with the standard error of a mean over the source's runs, and the p-value."""

    comparison: Comparison
    p: float


def against_moments(
    claim: Claim, moments: pd.DataFrame, kept: KeptTable, source_runs: int | None
) -> Iterator[Judged]:
    """A comparison for every filter, time and printed number."""
    actual = claim.statistic == "moment_actual"
    for time in claim.at:
        for label in claim.labels:
            here = moments[(moments["filter"] == label) & np.isclose(moments["time"].astype(float), time)]
            rows = {row.indices: row for row in here.itertuples()}
            sets = _moments_of_sets(kept, label, time, source_runs) if actual else None
            for indices, printed in (claim.printed or {}).items():
                row = rows.get(indices)
                if row is None or not source_runs:
                    yield Judged(Comparison(math.nan, math.nan, 0), 1.0)
                elif not actual:
                    stderr = row.estimated_stderr * math.sqrt(row.n / source_runs + 1)
                    margin = printed - row.estimated
                    yield Judged(Comparison(margin, stderr, row.n), _known(p_value(margin, stderr)))
                else:
                    stderr = row.stderr * math.sqrt(row.n / source_runs + 1)
                    p = _share(sets.of(indices), printed) if sets else math.nan
                    yield Judged(Comparison(printed - row.actual, stderr, row.n), _known(p))


class _Sets(NamedTuple):
    """Errors about the mean of their set, (C, sets, size)."""

    deviation: np.ndarray

    def of(self, indices: str) -> np.ndarray:
        """A central moment of each set; indices count coordinates from 1: `1,2`."""
        factors = self.deviation[[int(index) - 1 for index in indices.split(",")]]
        return factors.prod(0).mean(1)


def _moments_of_sets(kept: KeptTable, label: str, time: float, size: int | None) -> _Sets | None:
    columns = kept.columns(label, time, [*kept.coordinates, "diverged"])
    if not size or columns is None or size > kept.count:
        return None
    *errors, lost = columns
    sound = np.stack(errors)[:, ~lost.astype(bool)]
    if sound.shape[1] < size:
        return None
    drawn = kept.drawn(size, SETS) % sound.shape[1]
    error = sound[:, drawn]
    return _Sets(error - error.mean(-1, keepdims=True))


def _share(values: np.ndarray, printed: float) -> float:
    """Two-sided p-value of a printed number among those of sets, itself counted as one of them."""
    below, above = (values <= printed).sum() + 1, (values >= printed).sum() + 1
    return min(1.0, 2.0 * float(min(below, above)) / (len(values) + 1))


def _known(p: float) -> float:
    return 1.0 if math.isnan(p) else p
