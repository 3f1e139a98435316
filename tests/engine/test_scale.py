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
for runs in (100_000, 1_000_000):
    nb.run(experiment(reference=None, monte_carlo={"runs": runs, "seed": 11}), sys.argv[1])
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
def test_peak_memory_does_not_grow_with_the_number_of_runs(tmp_path):
    done = python(PEAK, str(tmp_path), xla_flags="")
    assert done.returncode == 0, done.stderr
    few, many = map(int, done.stdout.split())
    assert many < 1.2 * few


@pytest.mark.slow
def test_the_options_make_the_scalar_filter_at_least_twice_as_fast():
    assert speedup_by_options() >= 2.0
