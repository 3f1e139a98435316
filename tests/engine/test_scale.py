"""Claims: memory does not grow with the number of runs; XLA's options do what they are set for."""

from __future__ import annotations

import pytest

from nlbench.engine.effect import speedup_by_options
from tests.small_runs import python

PEAK = """
import resource, sys
import nlbench as nb
from tests.small_runs import experiment
nb.configure()
nb.run(experiment(reference=None, monte_carlo={"runs": int(sys.argv[1]), "seed": 11}), sys.argv[2])
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_peak_memory_does_not_grow_with_the_number_of_runs(tmp_path):
    peaks = []
    for runs in ("100000", "1000000"):
        done = python(PEAK, runs, str(tmp_path / runs))
        assert done.returncode == 0, done.stderr
        peaks.append(int(done.stdout))
    assert peaks[1] < 1.2 * peaks[0]


@pytest.mark.slow
def test_the_options_make_the_scalar_filter_at_least_twice_as_fast():
    assert speedup_by_options() >= 2.0
