"""Claim: on a small disk that fills up a run ends with 5 and without a partial file, and goes on when there is room."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.kills import checksums

ROOT = Path(__file__).parents[2]
SCRIPT = """
cd {folder}
mount -t tmpfs -o size={size} tmpfs disk || exit 99
run() {{ {python} -m nlbench run {config} --runs 3000 --out disk/results --yes; }}
run > said 2>&1; echo $? > code
find disk -type f > left; cp -r disk/results before
mount -o remount,size=64m disk
run > again 2>&1; echo $? >> code
cp -r disk/results after
"""


def in_private(script: str) -> subprocess.CompletedProcess:
    """Run a script that may mount what nobody else sees."""
    line = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(line, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.long
@pytest.mark.parametrize("size", ["64k", "300k", "700k", "1500k", "2m"])
def test_no_partial_file_and_the_same_tables_once_there_is_room(tmp_path, size):
    if not shutil.which("unshare") or in_private(f"mount -t tmpfs tmpfs {tmp_path}").returncode:
        pytest.skip("a private mount is not permitted here")
    for name in ("disk", "plain"):
        (tmp_path / name).mkdir()
    config = ROOT / "configs" / "quickstart.yaml"
    options = ["run", str(config), "--runs", "3000", "--out", str(tmp_path / "plain")]
    straight = [sys.executable, "-m", "nlbench", *options]
    subprocess.run(straight, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, check=True)
    script = SCRIPT.format(folder=tmp_path, size=size, python=sys.executable, config=config)
    assert in_private(script).returncode == 0
    first, second = (tmp_path / "code").read_text().split()
    said = (tmp_path / "said").read_text()
    assert first == "5", said
    assert "cannot write disk/results/" in said
    assert "No space left on device; needed" in said
    assert "; free " in said
    left = [Path(line) for line in (tmp_path / "left").read_text().splitlines()]
    assert not [path for path in left if ".partial" in path.name]
    whole = checksums(tmp_path / "plain")
    for path in (tmp_path / "before").rglob("tables/*"):
        if path.stem != "cost":
            assert hashlib.sha256(path.read_bytes()).hexdigest() == whole[path.name]
    assert second == "0", (tmp_path / "again").read_text()
    assert checksums(tmp_path / "after") == whole
