"""Claim: the command runs what a figure needs, reaches a verdict, and notices when that changes."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests import small_source

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.slow


def command(folder, *arguments):
    line = [sys.executable, "-m", "tests.small_source", "reproduce", "--quick", "--out", f"{folder}/out"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
    return [*line, "--configs", f"{folder}/configs", *arguments], {
        "cwd": ROOT,
        "env": environment,
        "text": True,
    }


def reproduce(folder, *arguments):
    line, options = command(folder, *arguments)
    return subprocess.run(line, capture_output=True, check=False, **options)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return small_source.write(tmp_path_factory.mktemp("reproduce") / "configs").parent


@pytest.fixture(scope="module")
def first(folder):
    return reproduce(folder, "--record")


def table(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_verdicts_are_printed_within_eighty_columns(first):
    assert first.returncode == 0, first.stderr
    lines = first.stdout.splitlines()
    assert "  figure 1        REPRODUCED (claims only)        Right" in lines
    assert "  figure 2        DIFFERS                         Wrong" in lines
    assert "  table 1         REPRODUCED                      Storage" in lines
    assert any(line.startswith("next: open ") for line in lines)
    assert all(len(line) <= 80 for line in lines if "/" not in line)
    assert "\033" not in first.stdout + first.stderr
    ahead, *done = first.stderr.splitlines()
    assert ahead == "2 experiments, 600 runs in all; those that are done are not run again"
    assert [line.split("  ")[0] for line in done] == ["1 of 2", "2 of 2"]
    assert {line.split("  ")[1].split(":")[0] for line in done} == {
        f"small-{name}, 300 runs" for name in "ab"
    }


def test_the_summary_is_written_with_its_tables_pictures_and_page(first, folder):
    made = folder / "out" / "reproduction-quick"
    verdicts = {row["entry"]: row for row in table(made / "verdicts.csv")}
    assert verdicts["figure 1"]["verdict"] == "REPRODUCED (claims only)"
    assert "Claim C2 of small-a" in verdicts["figure 2"]["because"]
    assert verdicts["figure 3"]["because"] == "A diagram without data."
    claims = {(row["experiment"], row["id"]): row for row in table(made / "claims.csv")}
    assert claims["small-a", "C1"]["verdict"] == "confirmed"
    assert float(claims["small-b", "C2"]["share_10"]) == 0
    pictures = {path.name for path in (made / "figures").iterdir()}
    assert pictures == {
        "small-1970-figure-1-rms-x.svg",
        "small-1970-figure-2-small-a-rms-x.svg",
        "small-1970-figure-2-small-b-rms-x.svg",
    }
    assert "Small things" in (made / "report.html").read_text()
    assert "Small things" in (made / "README.md").read_text()


def test_a_second_call_finds_all_done_and_as_recorded(first, folder):
    begun = time.monotonic()
    again = reproduce(folder)
    assert again.returncode == 0, again.stderr
    assert again.stderr.count("done before") == 2
    assert "4 as recorded" in again.stdout
    assert time.monotonic() - begun < 60


def test_a_changed_verdict_ends_with_three(first, folder):
    """Another bound in the claim: the same runs are read anew."""
    small_source.write(folder / "configs", below=1.0)
    changed = reproduce(folder, "--json")
    assert changed.returncode == 3
    assert "small-1970 figure 2: DIFFERS -> REPRODUCED (claims only)" in changed.stderr
    facts = json.loads(changed.stdout)
    assert facts["exit_code"] == 3
    assert [each["entry"] for each in facts["changed"]] == ["figure 2"]
    assert reproduce(folder, "--record", "--figure", "2").returncode == 0
    rows = {row["entry"]: row["verdict"] for row in table(folder / "out" / "reproduction" / "recorded.csv")}
    assert rows["figure 2"] == "REPRODUCED (claims only)"
    assert len(rows) == 4
    small_source.write(folder / "configs")


def test_ctrl_c_stops_the_runs_which_go_on_later(tmp_path):
    small_source.write(tmp_path / "configs", runs=100_000_000)
    line, options = command(tmp_path, "--figure", "1")
    line.remove("--quick")
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options) as process:
        deadline = time.monotonic() + 300
        while not (saved := list(tmp_path.glob("out/small-a/*/batches/checkpoint.npz"))):
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
    assert process.returncode == 130
    assert "goes on from what was saved" in said
    assert saved[0].exists()
    assert not list(tmp_path.glob("out/small-a/*/DONE"))
    assert _children(str(tmp_path)) == []


def _children(text):
    """Command lines of processes that mention the folder."""
    lines = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = path.read_bytes().replace(b"\0", b" ").decode(errors="replace")
        except OSError:
            continue
        if text in line:
            lines.append(line)
    return lines
