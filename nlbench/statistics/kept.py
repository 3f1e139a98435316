"""Errors of the first runs at the report times, kept one by one for medians, own plots and resampling."""

from collections.abc import Mapping

import numpy as np

from nlbench.statistics.layout import Layout


class KeptRuns:
    """The first `capacity` runs: errors (F, R, C, kept) and whether the filter lost the run (F, R, kept)."""

    def __init__(self, layout: Layout, capacity: int):
        filters, reports = len(layout.filters), len(layout.reports)
        self._error = np.empty((filters, reports, len(layout.coordinates), capacity))
        self._lost = np.empty((filters, reports, capacity), bool)
        self.count = 0

    def add(self, error: np.ndarray, lost: np.ndarray) -> None:
        """Keep as many of these runs as there is room for."""
        fit = min(error.shape[-1], self._error.shape[-1] - self.count)
        self._error[..., self.count : self.count + fit] = error[..., :fit]
        self._lost[..., self.count : self.count + fit] = lost[..., :fit]
        self.count += fit

    @property
    def error(self) -> np.ndarray:
        return self._error[..., : self.count]

    @property
    def lost(self) -> np.ndarray:
        return self._lost[..., : self.count]

    def state(self) -> dict[str, np.ndarray]:
        return {"kept_error": self.error.copy(), "kept_lost": self.lost.copy()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        self.count = 0
        self.add(state["kept_error"], state["kept_lost"])


def magnitudes(error: np.ndarray, layout: Layout) -> np.ndarray:
    """|error| of every coordinate and the named norms, along axis 2 of (F, R, C, runs)."""
    norms = [np.sqrt((error[:, :, list(members)] ** 2).sum(2)) for members in layout.norms.values()]
    return np.concatenate([np.abs(error), *(norm[:, :, None] for norm in norms)], axis=2)
