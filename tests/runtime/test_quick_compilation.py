"""Claim: what tests compile without LLVM's optimisation gives the numbers that users get, to rounding."""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb
from nlbench import config
from nlbench.results.results import Results
from tests.small_runs import python

ORBIT = {
    "experiment": "orbit",
    "system": {"name": "lunar-orbit", "coordinates": "polar"},
    "filters": ["second-order"],
    "time": {"end": 600.0, "step": 20.0, "output": 200.0},
    "report_times": [600.0],
}
SCALAR = {
    "experiment": "scalar",
    "system": "culver-scalar",
    "filters": ["third-order-guarded", "bootstrap"],
    "reference": "exact",
    "time": {"end": 0.5, "step": 0.02, "output": 0.1},
    "report_times": [0.5],
}


@pytest.mark.parametrize(
    "experiment", [pytest.param(SCALAR, id="scalar"), pytest.param(ORBIT, id="orbit", marks=pytest.mark.long)]
)
def test_numbers_are_those_of_optimised_programs(tmp_path, experiment):
    experiment = {**experiment, "monte_carlo": {"runs": 100, "seed": 3}, "engine": {"cost": False}}
    program = "import sys, nlbench; nlbench.run(sys.argv[1], out=sys.argv[2])"
    file = tmp_path / "experiment.yaml"
    file.write_text(config.from_dict(experiment).resolved_yaml())
    done = python(program, str(file), str(tmp_path / "users"), xla_flags="")
    assert done.returncode == 0, done.stderr
    mine = nb.run(experiment, tmp_path / "tests")
    users = Results(tmp_path / "users" / mine.path.relative_to(tmp_path / "tests"))
    assert mine.manifest["fingerprint"]["xla_flags"] != users.manifest["fingerprint"]["xla_flags"]
    for name in ("statistics", "runs"):
        ours, theirs = mine.table(name), users.table(name)
        numbers = ours.select_dtypes("number").columns
        assert ours.drop(columns=numbers).equals(theirs.drop(columns=numbers))
        for column in numbers:
            spread = np.nanstd(theirs[column]) + 1e-300
            np.testing.assert_allclose(ours[column] / spread, theirs[column] / spread, rtol=1e-6, atol=1e-6)
