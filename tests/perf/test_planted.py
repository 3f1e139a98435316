"""Claim: the command finds filters that do 1.3 times the work and passes filters unchanged, each 20 times of 20.

pytest -m long tests/perf/test_planted.py, on a machine that does nothing else.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from nlbench.perf.workloads import BLOCKS

TIMES = 20
ROOT = str(Path(__file__).parents[2])
PROGRAM = """
import sys
import nlbench.perf.workloads as workloads
workloads.BLOCKS = int(sys.argv.pop(1))
from nlbench.cli import main
main()
"""


def perf(blocks: int, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, each workload on this many blocks."""
    line = [sys.executable, "-c", PROGRAM, str(blocks), "perf", *map(str, arguments)]
    environment = os.environ | {"PYTHONPATH": ROOT}
    return subprocess.run(line, capture_output=True, text=True, env=environment, check=False)


@pytest.mark.long
@pytest.mark.parametrize(
    ("blocks", "code", "expected"), [(BLOCKS, 0, "pass"), (BLOCKS * 13 // 10, 3, "slower")]
)
def test_each_of_twenty_calls_decides_rightly(tmp_path, blocks, code, expected):
    file = tmp_path / "baseline.json"
    assert perf(BLOCKS, "--baseline", file, "--record").returncode == 0
    codes, verdicts = Counter(), Counter()
    for _ in range(TIMES):
        done = perf(blocks, "--baseline", file, "--json")
        codes[done.returncode] += 1
        verdicts.update(each["verdict"] for each in json.loads(done.stdout)["workloads"])
    assert codes == {code: TIMES}
    assert verdicts[expected] > 0
