"""Power sums about another origin are those of the moved numbers."""

from __future__ import annotations

import numpy as np

from nlbench.statistics.powers import shifted


def test_equals_the_power_sums_of_the_moved_numbers():
    rng = np.random.default_rng(1)
    d, shift = rng.normal(size=(3, 50)), rng.normal(size=(3, 1))
    sums = np.stack([(d**k).sum(-1) for k in range(7)])
    before = sums.copy()
    moved = np.stack([((d + shift) ** k).sum(-1) for k in range(7)])
    np.testing.assert_allclose(shifted(sums, shift[:, 0]), moved, rtol=1e-12)
    np.testing.assert_array_equal(sums, before)
