"""Claim: what is timed is the filter on all blocks, as often as is said."""

from __future__ import annotations

import jax
import numpy as np

from nlbench import config
from nlbench.engine import block, problem
from nlbench.perf import workloads
from nlbench.perf.workloads import BLOCKS, SEED


def test_a_filter_computes_all_blocks_as_often_as_it_is_called():
    experiment = config.from_dict({**workloads.SCALAR, "filters": ["ekf"]})
    stated = problem.make(experiment)
    lanes = jax.device_put(block.make_chunk(stated, 0, BLOCKS, BLOCKS, BLOCKS * stated.block).lanes)

    @jax.jit
    def components(number):
        made = block.trajectories(stated, block.words(SEED), jax.tree.map(lambda leaf: leaf[number], lanes))
        return block.followed(stated, stated.runners[0], made).components.sum((0, 1))

    expected = sum(components(number) for number in range(BLOCKS))
    (workload,) = workloads.of_experiments([experiment])
    np.testing.assert_allclose(workload.call(1), expected, rtol=1e-9)
    np.testing.assert_allclose(workload.call(3), 3 * expected, rtol=1e-9)
