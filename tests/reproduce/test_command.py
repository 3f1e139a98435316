"""Claim: the command answers at once what needs no run, in plain words."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from nlbench import config
from nlbench.reproduce.wording import in_words

ROOT = Path(__file__).parents[2]
HEAVY = ("jax", "numpy", "pandas", "matplotlib", "pyarrow", "scipy")
PROGRAM = f"""
import sys
from nlbench.cli import main
try:
    main()
finally:
    print("loaded:", *[name for name in {HEAVY} if name in sys.modules], file=sys.stderr)
"""


def nlbench(*arguments, cwd=ROOT):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    line = [sys.executable, "-c", PROGRAM, "reproduce", *arguments]
    return subprocess.run(line, capture_output=True, text=True, env=environment, check=False, cwd=cwd)


def test_help_says_the_default_and_loads_no_numerical_library():
    answer = nlbench("--help")
    assert answer.returncode == 0
    assert answer.stderr.strip() == "loaded:"
    assert "--quick" in answer.stdout
    assert "[default: full]" in " ".join(answer.stdout.split())
    assert all(len(line) <= 80 for line in answer.stdout.splitlines())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["kalman"], "unknown source 'kalman'"),
        (["culver", "--figure", "7.81"], "no source has a '7.81'"),
        (
            ["--configs", "nowhere"],
            "no folder 'nowhere' here; name the folder of the experiments with --configs",
        ),
    ],
)
def test_a_wrong_name_is_told_before_anything_is_run_or_written(arguments, message, tmp_path):
    answer = nlbench(*arguments, cwd=tmp_path)
    assert answer.returncode == 2
    assert message in answer.stderr
    assert answer.stderr.strip().endswith("loaded:")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_experiment_is_named(tmp_path):
    answer = nlbench("--figure", "7.19", "--configs", str(tmp_path))
    assert answer.returncode == 2
    assert "hermite-1.yaml: cannot read the experiment: no such file" in answer.stderr


CLAIM = {"id": "C1", "says": "so it is", "statistic": "rms"}


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"less": ["a", "b", "c"]}, "rms at t = 1: a < b < c"),
        ({"less": ["a", "b"], "factor": 2, "coordinate": "x"}, "rms of x at t = 1: 2 × a < b"),
        (
            {"less": ["a", "b"], "statistic": "variance_estimated", "agrees_with": "variance_actual"},
            "variance_estimated at t = 1: relative distance to variance_actual: a < b",
        ),
        ({"equal": ["a", "b"], "within": 0.02, "at": [0.5]}, "rms at t = 0.5: a = b within 2 %"),
        ({"of": ["a", "b"], "below": 0.3, "above": 0.1}, "rms at t = 1: of each of a, b, > 0.1 and < 0.3"),
        (
            {"of": ["a"], "statistic": "variance_estimated", "agrees_with": "variance_actual", "within": 0.1},
            "variance_estimated at t = 1: of a, within 10 % of variance_actual",
        ),
        (
            {"of": ["a"], "statistic": "variance_estimated", "less_than": "variance_actual", "factor": 3},
            "variance_estimated at t = 1: of a, 3 × itself < variance_actual",
        ),
        (
            {"of": ["a"], "statistic": "moment_actual", "printed": {"1,1": 2.5}},
            "moment_actual at t = 1: of a, as printed: (1,1) 2.5",
        ),
    ],
)
def test_a_test_is_said_in_words(keys, words):
    experiment = config.from_dict(
        {
            "experiment": "wording",
            "system": {"name": "culver-scalar"},
            "filters": [{"name": "third-order", "label": label} for label in "abc"],
            "time": {"end": 1.0, "step": 0.1, "output": 0.5},
            "report_times": [0.5, 1.0],
            "claims": [{"at": [1.0], **CLAIM, **keys}],
        }
    )
    assert in_words(experiment.claims[0], experiment) == words
