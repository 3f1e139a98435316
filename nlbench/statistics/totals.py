"""The running totals of an experiment: block sums merged on the host, in block order, into 64 groups.

Everything is float64 and of fixed size, whatever the number of runs. Power sums are moved from each block's
mean to a pivot (the mean of the first block in which the filter is alive), which is the same for all groups.
Only the last block may be padded: to top up later, keep the totals without it and add it to a copy.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from nlbench.statistics import histogram
from nlbench.statistics.kept import KeptRuns, magnitudes
from nlbench.statistics.layout import GROUPS, Layout
from nlbench.statistics.powers import shifted
from nlbench.statistics.uncertainty import JACKKNIFE_GROUPS

_ALWAYS_KEPT = 64 * JACKKNIFE_GROUPS  # so that with fewer groups the errors of all runs are at hand
_PREFIX = "group_"


class Totals:
    """Sums per group, histograms of |error| and kept errors; grows only by `add`."""

    def __init__(self, layout: Layout):
        shape = (len(layout.filters), len(layout.times), len(layout.coordinates))
        self.layout = layout
        self.blocks = 0
        self.runs = 0
        self.groups: dict[str, np.ndarray] = {}
        self.pivot = np.zeros((3, *shape))  # of error, variance and third
        bins = (shape[0], len(layout.reports), len(layout.magnitudes), histogram.BINS)
        self.histogram = np.zeros(bins, np.int64)
        self.kept = KeptRuns(layout, max(layout.keep_runs, _ALWAYS_KEPT))
        self._padded = False
        self._pivot_set = np.zeros(shape[:2], bool)
        self._scale = np.array(layout.scale)[:, None]
        self._bin_offset = np.arange(np.prod(bins[:-1])).reshape(*bins[:-1], 1) * histogram.BINS
        self._reports = np.array(layout.reports)
        pairs, triples = layout.components(2), layout.components(3)
        self._pairs, self._triples = np.array(pairs).T, np.array(triples).T
        self._rest = np.array([[pairs.index(t[:gone] + t[gone + 1 :]) for t in triples] for gone in range(3)])

    def add(self, block: int, sums: Mapping[str, Any]) -> None:
        """Add the sums of block number `block`, which must be the next one."""
        if block != self.blocks:
            raise ValueError(
                f"block {block} came when block {self.blocks} was due: blocks are added in order"
            )
        if self._padded:
            raise ValueError(f"block {block - 1} was padded: add a padded block to a copy of the totals only")
        host = {name: np.asarray(value) for name, value in sums.items()}
        error, lost = host.pop("report_error"), host.pop("report_diverged")
        count = int(host["total"])
        moved = self._move_to_pivot(host)
        if not self.groups:
            self.groups = {name: np.zeros((GROUPS, *value.shape)) for name, value in moved.items()}
        for name, value in moved.items():
            self.groups[name][block % GROUPS] += value
        self._add_runs(error[..., :count].astype(np.float64), lost[..., :count])
        self.blocks += 1
        self.runs += count
        self._padded = count < lost.shape[-1]

    def _move_to_pivot(self, sums: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The block's sums with all powers of error, variance and third about the pivot."""
        mean, power = sums.pop("mean").astype(np.float64), sums.pop("power")
        alive = sums["alive"][..., None].astype(np.float64)
        if not self._pivot_set.all():
            fresh = ~self._pivot_set & (sums["alive"] > 0)
            self.pivot[:, fresh] = mean[:, fresh]
            self._pivot_set |= fresh
        shift = np.where(alive > 0, mean - self.pivot, 0.0)
        about = np.zeros((7, *power.shape[1:]))  # sums of d^0 ... d^6; that of d is zero about the mean
        about[0], about[2:] = alive, power
        first = alive * shift[1:]
        cross = self._move_cross(sums, shift[0][:, self._reports], alive[:, self._reports])
        power = shifted(about, shift[0])[1:]
        return {**sums, "power": power, "first": first, "spread": sums["spread"] + first * shift[1:], **cross}

    def _move_cross(
        self, sums: dict[str, np.ndarray], shift: np.ndarray, alive: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Joint sums, s being the shift: S_ij + n s_i s_j, and S_ijk + 3 {s_i S_jk} + n s_i s_j s_k."""
        i, j = self._pairs
        factors = shift[:, :, self._triples]
        second = sums["cross_second"].astype(np.float64)
        third = sums["cross_third"] + (factors * second[:, :, self._rest]).sum(2)
        return {
            "cross_second": second + alive * shift[:, :, i] * shift[:, :, j],
            "cross_third": third + alive * factors.prod(2),
        }

    def _add_runs(self, error: np.ndarray, lost: np.ndarray) -> None:
        size = np.where(lost[:, :, None], np.inf, magnitudes(error, self.layout) / self._scale)
        bins = histogram.bin_of(size) + self._bin_offset
        np.add.at(self.histogram.reshape(-1), bins.ravel(), 1)
        self.kept.add(error, lost)

    @property
    def all_kept(self) -> bool:
        """Whether the errors of all runs are at hand."""
        return self.kept.count == self.runs

    @property
    def filled_groups(self) -> int:
        return min(self.blocks, GROUPS)

    def state(self) -> dict[str, np.ndarray]:
        """Everything as arrays, for a checkpoint."""
        return {
            "counters": np.array([self.blocks, self.runs, self._padded], np.int64),
            "pivot": self.pivot.copy(),
            "pivot_set": self._pivot_set.copy(),
            "histogram": self.histogram.copy(),
            **self.kept.state(),
            **{_PREFIX + name: value.copy() for name, value in self.groups.items()},
        }

    @classmethod
    def from_state(cls, layout: Layout, state: Mapping[str, np.ndarray]) -> "Totals":
        """The totals that `state` was taken from."""
        totals = cls(layout)
        totals.blocks, totals.runs = (int(value) for value in state["counters"][:2])
        totals._padded = bool(state["counters"][2])
        totals.pivot, totals._pivot_set = state["pivot"].copy(), state["pivot_set"].copy()
        totals.histogram = state["histogram"].copy()
        totals.kept.restore(state)
        totals.groups = {k.removeprefix(_PREFIX): v.copy() for k, v in state.items() if k.startswith(_PREFIX)}
        return totals

    def copy(self) -> "Totals":
        """Independent totals with the same content."""
        return Totals.from_state(self.layout, self.state())
