"""Which blocks of a run one machine computes: those of some of the 64 groups, the groups dealt out in turn.

A group's sums are added up by themselves, in the order of its blocks. Who has all blocks of a group therefore makes
exactly the sums that one machine would have made.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nlbench.statistics.layout import GROUPS


class Share(NamedTuple):
    """Share `number` (from 0) of `of`: the groups number, number + of, ... A place counts the blocks of the share."""

    number: int = 0
    of: int = 1

    @property
    def groups(self) -> np.ndarray:
        """Numbers of the groups."""
        return np.arange(self.number, GROUPS, self.of)

    def blocks(self, first: int, count: int) -> np.ndarray:
        """Numbers of the blocks at places first, first + 1, ... (count,), 64 bits without sign."""
        groups = self.groups.astype(np.uint64)
        places = np.uint64(first) + np.arange(count, dtype=np.uint64)
        rounds, within = np.divmod(places, np.uint64(len(groups)))
        return rounds * np.uint64(GROUPS) + groups[within.astype(np.int64)]

    def count(self, blocks: int) -> int:
        """How many of the run's first `blocks` blocks are the share's."""
        rounds, rest = divmod(blocks, GROUPS)
        return rounds * len(self.groups) + len(range(self.number, rest, self.of))

    def runs(self, runs: int, lanes: int) -> int:
        """How many of the run's first `runs` runs are the share's, in blocks of `lanes` runs."""
        whole, rest = divmod(runs, lanes)
        last = whole % GROUPS % self.of == self.number
        return self.count(whole) * lanes + rest * last


ALL = Share()
