"""The totals of a run from those of its shares, to the last bit those of one machine.

Sums belong to groups, and each group to one share; histograms are whole numbers; kept runs go to their place in the
run. Nothing is rounded, so nothing depends on which machine had which share.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlbench.statistics.kept import Reported
from nlbench.statistics.layout import GROUPS, Layout
from nlbench.statistics.totals import GROUP_PREFIX, Totals


def joined(layout: Layout, parts: Sequence[Totals], lanes: int) -> Totals:
    """Totals of whole blocks of `lanes` runs. parts: one for each share, all of the same number of blocks of the run.

    Raises `ValueError` where the shares are not all there, or their pivots differ, which those of one run never do.
    """
    shares = sorted(part.share for part in parts)
    if not shares or shares != [(number, shares[0].of) for number in range(shares[0].of)]:
        raise ValueError("each share must be there once")
    filled = [part for part in parts if part.blocks]
    if not filled:
        return Totals(layout)
    if len({part.pivot.tobytes() for part in filled}) > 1:
        raise ValueError("the shares have different pivots: they are not of one run")
    blocks = sum(part.blocks for part in filled)
    if any(part.blocks != part.share.count(blocks) for part in parts):
        raise ValueError("the shares are not of the same number of blocks")
    state = filled[0].state() | Totals(layout).kept.state()
    state["counters"] = np.array([blocks, sum(part.runs for part in filled), False], np.int64)
    state["share"] = np.array((0, 1, lanes), np.int64)
    state["histogram"] = np.sum([part.histogram for part in filled], axis=0)
    for name, value in filled[0].groups.items():
        groups = np.zeros((GROUPS, *value.shape[1:]))
        for part in filled:
            groups[part.share.groups] = part.groups[name][part.share.groups]
        state[GROUP_PREFIX + name] = groups
    return Totals.from_state(layout, state | _kept(filled, lanes))


def _kept(parts: Sequence[Totals], lanes: int) -> dict[str, np.ndarray]:
    """The kept runs of all parts in the order of the run."""
    places = []
    for part in parts:
        blocks = part.share.blocks(0, -(-part.kept.count // lanes)).astype(np.int64)
        numbers = (blocks[:, None] * lanes + np.arange(lanes)).ravel()
        places.append(numbers[: part.kept.count])
    order = np.argsort(np.concatenate(places), kind="stable")
    return {
        f"kept_{name}": np.concatenate([getattr(part.kept.runs, name) for part in parts], -1)[..., order]
        for name in Reported._fields
    }
