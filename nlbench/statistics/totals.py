"""The running totals of an experiment: block sums merged on the host, in block order, into 64 groups.

Everything is float64 and of fixed size, whatever the number of runs. Power sums are moved from each block's
mean to a pivot, which is the same for all groups: the mean of block 0, and zero where block 0 lost a filter altogether.
Totals may be those of a share of the groups; all shares of a run make those of one machine (`statistics.joined`).
Only the last block may be padded: to top up later, keep the totals without it and add it to a copy.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from nlbench.statistics import histogram
from nlbench.statistics.ieee import ieee
from nlbench.statistics.kept import KeptRuns, Reported, magnitudes
from nlbench.statistics.layout import GROUPS, Layout
from nlbench.statistics.powers import shifted
from nlbench.statistics.share import ALL, Share
from nlbench.statistics.uncertainty import JACKKNIFE_GROUPS

_ALWAYS_KEPT = 64 * JACKKNIFE_GROUPS  # so that with fewer groups the errors of all runs are at hand
GROUP_PREFIX = "group_"


def _in_a_row(array: np.ndarray) -> np.ndarray:
    """(B, ..., L) of blocks as (..., B L): their runs in a row."""
    moved = np.moveaxis(array, 0, -2)
    return moved.reshape(*moved.shape[:-2], -1)


class Totals:
    """Sums per group, histograms of |error| and kept errors; grows only by `add`."""

    def __init__(self, layout: Layout, share: Share = ALL, lanes: int = 1):
        """share: the groups whose blocks are added. lanes: runs of a block, which count where not all groups are."""
        shape = (len(layout.filters), len(layout.times), len(layout.coordinates))
        self.layout = layout
        self.share, self._lanes = share, lanes
        self.blocks = 0
        self.runs = 0
        self.groups: dict[str, np.ndarray] = {}
        self.pivot = np.zeros((3, *shape))  # of error, variance and third
        bins = (shape[0], len(layout.reports), len(layout.magnitudes), histogram.BINS)
        self.histogram = np.zeros(bins, np.int64)
        self.kept = KeptRuns(layout, share.runs(max(layout.keep_runs, _ALWAYS_KEPT), lanes))
        self.centred = False  # whether the pivot is known
        self._padded = False
        self._scale = np.array(layout.scale)[:, None]
        self._bin_offset = np.arange(np.prod(bins[:-1])).reshape(*bins[:-1], 1) * histogram.BINS
        self._reports = np.array(layout.reports)
        pairs, triples = layout.components(2), layout.components(3)
        self._pairs, self._triples = np.array(pairs).T, np.array(triples).T
        self._rest = np.array([[pairs.index(t[:gone] + t[gone + 1 :]) for t in triples] for gone in range(3)])

    @ieee
    def add(self, first: int, sums: Mapping[str, Any]) -> None:
        """Add the sums of blocks first, first + 1, ..., stacked along a leading axis; `first` must be the next block.

        Of a share these are places (`Share`), and one without block 0 needs `centre` first. The result is the same, to
        the last bit, however the blocks are split over calls.
        """
        if first != self.blocks:
            raise ValueError(
                f"block {first} came when block {self.blocks} was due: blocks are added in order"
            )
        count = len(sums["total"])
        most = len(self.share.groups)
        for start in range(0, count, most):  # no two blocks of a part are of the same group
            self._add({name: np.asarray(value)[start : start + most] for name, value in sums.items()})

    def centre(self, sums: Mapping[str, Any]) -> None:
        """Take the pivot from the sums of blocks of which the first is block 0 of the run, unless it is known."""
        if not self.centred:
            alive = np.asarray(sums["alive"])[0] > 0
            self.pivot[:, alive] = np.asarray(sums["mean"])[0].astype(np.float64)[:, alive]
            self.centred = True

    def _add(self, host: dict[str, np.ndarray]) -> None:
        given = Reported(*(host.pop(f"report_{name}") for name in Reported._fields))
        real, lanes = host["total"], given.lost.shape[-1]
        if self._padded or (real[:-1] < lanes).any():
            raise ValueError(
                "a block after a padded one: add a padded block last, and to a copy of the totals only"
            )
        if self.share.number == 0:
            self.centre(host)
        elif not self.centred:
            raise ValueError("a share without block 0 must be told the pivot before blocks are added")
        moved = self._move_to_pivot(host)
        if not self.groups:
            self.groups = {name: np.zeros((GROUPS, *value.shape[1:])) for name, value in moved.items()}
        group = self.share.groups[(self.blocks + np.arange(len(real))) % len(self.share.groups)]
        for name, value in moved.items():
            self.groups[name][group] += value
        runs = int(real.sum())
        self._add_runs(Reported(*(_in_a_row(part)[..., :runs] for part in given)))
        self.blocks += len(real)
        self.runs += runs
        self._padded = bool(real[-1] < lanes)

    def _move_to_pivot(self, sums: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The blocks' sums with all powers of error, variance and third about the pivot."""
        mean, power = sums.pop("mean").astype(np.float64), sums.pop("power")
        alive = sums["alive"][..., None].astype(np.float64)
        shift = np.where(alive[:, None] > 0, mean - self.pivot, 0.0)
        # Sums of d^0 ... d^6; that of d is zero about the mean.
        about = np.zeros((7, len(mean), *power.shape[2:]))
        about[0], about[2:] = alive, np.moveaxis(power, 1, 0)
        first = alive[:, None] * shift[:, 1:]
        cross = self._move_cross(sums, shift[:, 0][:, :, self._reports], alive[:, :, self._reports])
        power = np.moveaxis(shifted(about, shift[:, 0])[1:], 0, 1)
        return {
            **sums,
            "power": power,
            "first": first,
            "spread": sums["spread"] + first * shift[:, 1:],
            **cross,
        }

    def _move_cross(
        self, sums: dict[str, np.ndarray], shift: np.ndarray, alive: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Joint sums about the pivot: S_ij + n s_i s_j, and S_ijk + s_i S_jk + s_j S_ik + s_k S_ij + n s_i s_j s_k."""
        i, j = self._pairs
        factors = shift[..., self._triples]
        second = sums["cross_second"].astype(np.float64)
        third = sums["cross_third"] + (factors * second[..., self._rest]).sum(-2)
        return {
            "cross_second": second + alive * shift[..., i] * shift[..., j],
            "cross_third": third + alive * factors.prod(-2),
        }

    def _add_runs(self, runs: Reported) -> None:
        size = magnitudes(runs.error.astype(np.float64), self.layout) / self._scale
        size = np.where(runs.lost[:, :, None], np.inf, size)
        bins = histogram.bin_of(size) + self._bin_offset
        flat = self.histogram.reshape(-1)
        flat += np.bincount(bins.ravel(), minlength=flat.size)
        self.kept.add(runs)

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
            "pivot_set": np.array(self.centred),
            "share": np.array((*self.share, self._lanes), np.int64),
            "histogram": self.histogram.copy(),
            **self.kept.state(),
            **{GROUP_PREFIX + name: value.copy() for name, value in self.groups.items()},
        }

    @classmethod
    def from_state(cls, layout: Layout, state: Mapping[str, np.ndarray]) -> "Totals":
        """The totals that `state` was taken from."""
        number, of, lanes = (int(value) for value in state.get("share", (*ALL, 1)))
        totals = cls(layout, Share(number, of), lanes)
        totals.blocks, totals.runs = (int(value) for value in state["counters"][:2])
        totals._padded = bool(state["counters"][2])
        totals.pivot, totals.centred = state["pivot"].copy(), bool(state["pivot_set"].any())
        totals.histogram = state["histogram"].copy()
        totals.kept.restore(state)
        totals.groups = {
            k.removeprefix(GROUP_PREFIX): v.copy() for k, v in state.items() if k.startswith(GROUP_PREFIX)
        }
        return totals

    def copy(self) -> "Totals":
        """Independent totals with the same content."""
        return Totals.from_state(self.layout, self.state())
