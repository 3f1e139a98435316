"""Totals depend on the runs and their order alone: not on where they were interrupted, saved or copied."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench.statistics.layout import GROUPS
from nlbench.statistics.totals import Totals
from tests.statistics import made_runs

LAYOUT = made_runs.layout(keep_runs=100)


@pytest.fixture(scope="module")
def all_sums():
    runs = made_runs.make(LAYOUT, 64 * 70 + 10, seed=5)
    return [made_runs.stacked([made_runs.block_sums(*block, LAYOUT)]) for block in made_runs.blocks(runs)]


def summed(all_sums) -> Totals:
    totals = Totals(LAYOUT)
    for number, sums in enumerate(all_sums):
        totals.add(number, sums)
    return totals


def assert_same_bits(a: Totals, b: Totals) -> None:
    first, second = a.state(), b.state()
    assert first.keys() == second.keys()
    for name in first:
        assert first[name].dtype == second[name].dtype
        assert first[name].tobytes() == second[name].tobytes(), name


@pytest.mark.parametrize("number", [0, 2, -1])
def test_refuses_a_block_out_of_order(all_sums, number):
    totals = summed(all_sums[:1])
    with pytest.raises(ValueError, match="when block 1 was due"):
        totals.add(number, all_sums[1])


def test_refuses_a_block_after_a_padded_one(all_sums):
    totals = summed(all_sums)
    with pytest.raises(ValueError, match="padded"):
        totals.add(71, all_sums[0])


@pytest.mark.parametrize("stop", [0, 1, 33, 64, 70])
def test_a_saved_state_goes_on_without_changing_one_bit(all_sums, stop):
    saved = summed(all_sums[:stop]).state()
    resumed = Totals.from_state(LAYOUT, saved)
    for number in range(stop, len(all_sums)):
        resumed.add(number, all_sums[number])
    assert_same_bits(resumed, summed(all_sums))


@pytest.mark.parametrize("size", [2, 7, 64, 71])
def test_blocks_added_together_give_the_same_bits_as_one_by_one(all_sums, size):
    together = Totals(LAYOUT)
    for first in range(0, len(all_sums), size):
        part = all_sums[first : first + size]
        together.add(first, {name: np.concatenate([block[name] for block in part]) for name in part[0]})
    assert_same_bits(together, summed(all_sums))


def test_a_padded_block_inside_is_refused(all_sums):
    both = {name: np.concatenate([all_sums[70][name], all_sums[0][name]]) for name in all_sums[0]}
    with pytest.raises(ValueError, match="padded"):
        Totals(LAYOUT).add(0, both)


def test_adding_to_a_copy_leaves_the_original_alone(all_sums):
    totals = summed(all_sums[:70])
    before = Totals.from_state(LAYOUT, totals.state())
    copy = totals.copy()
    copy.add(70, all_sums[70])
    assert_same_bits(totals, before)
    assert (copy.runs, totals.runs) == (64 * 70 + 10, 64 * 70)


def test_a_state_does_not_change_when_blocks_are_added_later(all_sums):
    totals = summed(all_sums[:2])
    state = totals.state()
    before = {name: array.copy() for name, array in state.items()}
    totals.add(2, all_sums[2])
    for name, array in before.items():
        np.testing.assert_array_equal(state[name], array)


def test_totals_made_from_a_state_leave_it_as_it_is(all_sums):
    state = summed(all_sums[:2]).state()
    before = {name: array.copy() for name, array in state.items()}
    Totals.from_state(LAYOUT, state).add(2, all_sums[2])
    for name, array in before.items():
        np.testing.assert_array_equal(state[name], array)


def test_blocks_go_round_the_groups(all_sums):
    totals = summed(all_sums)
    assert GROUPS == 64
    assert totals.groups["total"].tolist() == [128.0] * 6 + [74.0] + [64.0] * 57


def test_memory_does_not_grow_with_the_number_of_runs(all_sums):
    def size(totals: Totals) -> int:
        arrays = [
            *totals.groups.values(),
            totals.histogram,
            totals.pivot,
            *totals.kept._room,
        ]
        return sum(array.nbytes for array in arrays)

    totals = summed(all_sums[:1])
    start = size(totals)
    for number in range(1, 500):
        totals.add(number, all_sums[number % 70])
    assert size(totals) == start
    assert totals.kept.count == 2048


def test_the_pivot_is_the_mean_of_block_0_and_zero_where_it_lost_the_filter():
    runs = made_runs.make(LAYOUT, 128, seed=6, lost=0.0)
    runs.diverged[1, :, :64] = True
    totals = made_runs.total(runs, LAYOUT)
    np.testing.assert_array_equal(totals.pivot[:, 1], 0)
    np.testing.assert_allclose(totals.pivot[0][0], runs.error[0, :, :, :64].mean(-1) / [1.5, 2.0], rtol=1e-12)


def test_an_offset_a_million_times_the_spread_costs_no_digits_of_variance_and_third():
    from nlbench.statistics.summary import statistics_table

    runs = made_runs.make(LAYOUT, 640, seed=7, lost=0.0)
    rounded = np.round(runs.error * 2**20) / 2**20  # so that adding the offset is exact
    near = made_runs.keyed(statistics_table(made_runs.total(runs._replace(error=rounded), LAYOUT)))
    far = made_runs.keyed(statistics_table(made_runs.total(runs._replace(error=rounded + 2**20), LAYOUT)))
    for key, row in near.items():
        if key[3] in ("variance_actual", "third_actual"):
            # The block means themselves round at 1e-10 of the spread.
            assert far[key].value == pytest.approx(row.value, rel=1e-7)
            assert far[key].stderr == pytest.approx(row.stderr, rel=1e-7)
        if key[3] == "mean_error":
            assert far[key].value - 2**20 == pytest.approx(row.value, abs=1e-9)
            assert far[key].stderr == pytest.approx(row.stderr, rel=1e-7)
