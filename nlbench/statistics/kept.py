"""What filters did at the report times in the first runs, kept one by one for medians, densities and resampling."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from nlbench.statistics.layout import Layout


class Reported(NamedTuple):
    """Of runs at the report times: errors (F, R, C, runs), the variances and third moments that the filters state for
    them (the same, in single precision), and whether the filter lost the run (F, R, runs)."""

    error: np.ndarray
    variance: np.ndarray
    third: np.ndarray
    lost: np.ndarray


class KeptRuns:
    """The first `capacity` runs."""

    def __init__(self, layout: Layout, capacity: int):
        shape = (len(layout.filters), len(layout.reports), len(layout.coordinates), capacity)
        self._room = Reported(
            np.empty(shape),
            np.empty(shape, np.float32),
            np.empty(shape, np.float32),
            np.empty((*shape[:2], capacity), bool),
        )
        self.count = 0

    def add(self, runs: Reported) -> None:
        """Keep as many of these runs as there is room for."""
        fit = min(runs.lost.shape[-1], self._room.lost.shape[-1] - self.count)
        for room, given in zip(self._room, runs, strict=True):
            room[..., self.count : self.count + fit] = given[..., :fit]
        self.count += fit

    @property
    def capacity(self) -> int:
        """How many runs there is room for."""
        return self._room.lost.shape[-1]

    @property
    def bytes_of_a_run(self) -> int:
        return sum(part.nbytes for part in self._room) // max(1, self.capacity)

    @property
    def runs(self) -> Reported:
        """All that is kept."""
        return Reported(*(part[..., : self.count] for part in self._room))

    @property
    def error(self) -> np.ndarray:
        return self.runs.error

    @property
    def lost(self) -> np.ndarray:
        return self.runs.lost

    def state(self) -> dict[str, np.ndarray]:
        return {f"kept_{name}": part.copy() for name, part in self.runs._asdict().items()}

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        self.count = 0
        self.add(Reported(*(state[f"kept_{name}"] for name in Reported._fields)))


def magnitudes(error: np.ndarray, layout: Layout) -> np.ndarray:
    """|error| of every coordinate and the named norms, along axis 2 of (F, R, C, runs)."""
    norms = [np.sqrt((error[:, :, list(members)] ** 2).sum(2)) for members in layout.norms.values()]
    return np.concatenate([np.abs(error), *(norm[:, :, None] for norm in norms)], axis=2)
