"""Claims: the shares of a run have each block once; joined, they are the totals of one machine to the last bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nlbench.statistics.joined import joined
from nlbench.statistics.share import Share
from nlbench.statistics.totals import Totals
from tests.statistics import made_runs

LANES = made_runs.LANES
BLOCKS = 150
LAYOUT = made_runs.layout(filters=2, times=2, keep_runs=3000)  # 46 blocks and part of one


@pytest.fixture(scope="module")
def all_sums():
    runs = made_runs.make(LAYOUT, LANES * BLOCKS, seed=5)
    runs.diverged[1, :, :LANES] = True  # so that one filter has no pivot
    return [made_runs.stacked([made_runs.block_sums(*block, LAYOUT)]) for block in made_runs.blocks(runs)]


def whole(all_sums) -> Totals:
    totals = Totals(LAYOUT)
    for number, sums in enumerate(all_sums):
        totals.add(number, sums)
    return totals


def part(all_sums, share: Share, size: int = 5) -> Totals:
    totals = Totals(LAYOUT, share, LANES)
    totals.centre(all_sums[0])
    mine = [all_sums[b] for b in range(len(all_sums)) if b % 64 % share.of == share.number]
    for first in range(0, len(mine), size):
        some = mine[first : first + size]
        totals.add(first, {name: np.concatenate([sums[name] for sums in some]) for name in some[0]})
    return Totals.from_state(LAYOUT, totals.state())


@given(of=st.integers(1, 64), blocks=st.integers(0, 1000), lanes=st.sampled_from([1, 64, 256]))
def test_each_block_and_each_run_is_in_one_share(of, blocks, lanes):
    shares = [Share(number, of) for number in range(of)]
    found = np.concatenate([share.blocks(0, share.count(blocks)) for share in shares])
    assert sorted(found) == list(range(blocks))
    runs = blocks * lanes + lanes // 3
    assert sum(share.runs(runs, lanes) for share in shares) == runs


def test_numbers_of_blocks_have_64_bits():
    share = Share(2, 3)
    place = share.count(2**60)
    assert int(share.blocks(place - 1, 1)[0]) < 2**60 <= int(share.blocks(place, 1)[0])


@pytest.mark.parametrize("of", [1, 2, 3, 64])
def test_joined_shares_are_the_totals_of_one_machine(all_sums, of):
    parts = [part(all_sums, Share(number, of)) for number in range(of)]
    made, expected = joined(LAYOUT, parts[::-1], LANES).state(), whole(all_sums).state()
    for state in (made, expected):
        del state["share"]
    assert made.keys() == expected.keys()
    for name in made:
        assert made[name].tobytes() == expected[name].tobytes(), name


def test_joined_totals_take_more_blocks_as_those_of_one_machine(all_sums):
    parts = [part(all_sums[:-1], Share(number, 3)) for number in range(3)]
    totals = joined(LAYOUT, parts, LANES)
    totals.add(BLOCKS - 1, all_sums[-1])
    assert totals.groups["power"].tobytes() == whole(all_sums).groups["power"].tobytes()


@pytest.mark.parametrize("numbers", [(0, 1), (0, 1, 1), (0, 1, 2, 2), ()])
def test_shares_missing_or_twice_are_refused(all_sums, numbers):
    with pytest.raises(ValueError, match="there once"):
        joined(LAYOUT, [part(all_sums[:9], Share(number, 3)) for number in numbers], LANES)


def test_shares_of_other_runs_are_refused(all_sums):
    other = made_runs.make(LAYOUT, LANES * 9, seed=6)
    sums = [made_runs.stacked([made_runs.block_sums(*block, LAYOUT)]) for block in made_runs.blocks(other)]
    with pytest.raises(ValueError, match="not of one run"):
        joined(LAYOUT, [part(all_sums[:9], Share(0, 2)), part(sums, Share(1, 2))], LANES)


def test_shares_of_different_lengths_are_refused(all_sums):
    with pytest.raises(ValueError, match="same number of blocks"):
        joined(LAYOUT, [part(all_sums[:9], Share(0, 2)), part(all_sums[:3], Share(1, 2))], LANES)


def test_a_share_without_block_0_must_be_told_the_pivot(all_sums):
    with pytest.raises(ValueError, match="pivot"):
        Totals(LAYOUT, Share(1, 2), LANES).add(0, all_sums[1])
