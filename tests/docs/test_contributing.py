"""Claim: the steps of "Adding a filter" in CONTRIBUTING, followed to the letter, add a filter that passes its tests."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parents[2]
TEXT = (HERE / "CONTRIBUTING.md").read_text()
ADDING = re.search(r"## Adding a filter\n(.*?)\n## ", TEXT, re.DOTALL).group(1)
NAME = "central-difference"
RUN = f"""
import nlbench as nb
results = nb.run({{
    "experiment": "added",
    "system": "ungm",
    "filters": ["{NAME}", "ghkf"],
    "time": {{"end": 20, "output": 10}},
    "monte_carlo": {{"runs": 64, "seed": 1}},
}})
print(results.table("statistics").query("filter == '{NAME}' and statistic == 'rms'")["value"].max())
"""


def step(title: str) -> tuple[str, str]:
    """The file that a step names, and the code that goes into it."""
    text, code = re.search(rf"\*\*The {title}\*\*(.*?)```python\n(.*?)```", ADDING, re.DOTALL).groups()
    return re.search(r"`((?:nlbench|tests)/[\w/]+\.py)`", text).group(1), code


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A copy of the project in which the three steps were taken, and nothing else."""
    folder = tmp_path_factory.mktemp("copy")
    for part in ("nlbench", "tests"):
        shutil.copytree(HERE / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(HERE / "pyproject.toml", folder)
    name, code = step("file")
    assert not (folder / name).exists()
    (folder / name).write_text(code)
    for title, table in (("line", r"ROWS: .* = \{\n"), ("row", r"EXPECTED = \{\n")):
        name, code = step(title)
        before = (folder / name).read_text()
        after, inserted = re.subn(f"(?m)^({table})", lambda found, code=code: found.group(1) + code, before)
        assert inserted == 1
        assert len(code.splitlines()) == 1
        (folder / name).write_text(after)
    return folder


def python(folder: Path, *arguments: str) -> str:
    """What python prints there, with that copy of the package."""
    environment = os.environ | {"PYTHONPATH": str(folder), "COLUMNS": "80"}
    line = [sys.executable, *arguments]
    done = subprocess.run(line, capture_output=True, text=True, cwd=folder, env=environment, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_the_added_filter_is_listed_and_runs_in_an_experiment(copy):
    assert NAME in python(copy, "-m", "nlbench", "list", "filters")
    assert 0 < float(python(copy, "-c", RUN)) < 100


def test_the_added_file_is_in_the_style_of_the_others(copy):
    name, _ = step("file")
    for command in (["check"], ["format", "--check"]):
        python(copy, "-m", "ruff", *command, name)


def test_the_added_filter_passes_its_row_and_the_test_of_rows_knows_it(copy):
    said = python(
        copy, "-m", "pytest", "-q", "tests/discrete/test_quadratic_motion.py", "-k", f"{NAME} or row"
    )
    assert "2 passed" in said


@pytest.mark.slow
def test_the_added_filter_passes_the_contract_of_all_filters(copy):
    said = python(copy, "-m", "pytest", "-q", "-m", "", "tests/discrete/test_contract.py", "-k", NAME)
    assert int(re.search(r"(\d+) passed", said).group(1)) >= 9
