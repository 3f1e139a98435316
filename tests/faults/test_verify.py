"""Claim: `verify` passes what a run wrote, names what was changed since, and sees numbers that come out otherwise."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench import engine
from nlbench.cli.app import app
from nlbench.engine import verification
from nlbench.errors import ConfigError, EnvironmentFault
from nlbench.results.folder import CHECKPOINT, MANIFEST, RunFolder
from nlbench.results.manifest import read_manifest
from nlbench.results.results import Results
from nlbench.results.tables import write_table

OWN_FACTS = ("schema", "checksums", "runs")


@pytest.fixture(autouse=True)
def compiled_before(program, monkeypatch):
    monkeypatch.setattr(verification, "make", lambda experiment: program.problem)
    monkeypatch.setattr(verification, "compile_chunks", lambda problem, seed: program)


@pytest.fixture
def folder(undisturbed, tmp_path):
    """A copy, to be spoiled."""
    return shutil.copytree(undisturbed, tmp_path / "run")


def rewritten(folder, **changes):
    """A manifest that fits what lies in the folder now: what a careful forger leaves."""
    facts = {key: value for key, value in read_manifest(folder / MANIFEST).items() if key not in OWN_FACTS}
    tables = [f"tables/{path.name}" for path in (folder / "tables").iterdir()]
    RunFolder(folder).finish(1000, tables, **{**facts, **changes})


def bytes_of(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("block", [None, 0, 14, 15])
def test_what_a_run_wrote_is_sound_and_stays_as_it_is(folder, block):
    before = bytes_of(folder)
    found = engine.verify(folder, block)
    assert (found.faults, found.remarks, found.same) == ((), (), True)
    assert found.files == len(Results(folder).manifest["checksums"])
    assert found.recomputed == (
        1 if block == 15 else 2
    )  # a block of its own group, and the last, partial one
    assert bytes_of(folder) == before


@pytest.mark.parametrize(
    "name",
    ["tables/statistics.csv", "tables/runs.parquet", CHECKPOINT, MANIFEST, "config.resolved.yaml", "DONE"],
)
def test_a_changed_or_missing_file_is_named(folder, name):
    path = folder / name
    data = bytearray(path.read_bytes())
    data[0 if name == "DONE" else len(data) // 2] ^= 2
    path.write_bytes(data)
    done = CliRunner().invoke(app, ["verify", str(folder), "--json"])
    assert done.exit_code == 5
    assert str(path) in json.loads(done.stdout)["faults"][0]
    path.unlink()
    done = CliRunner().invoke(app, ["verify", str(folder)])
    assert done.exit_code == 5
    assert str(folder) in done.stderr


def test_a_file_that_the_run_did_not_write_is_named(folder):
    (folder / "tables" / "statistics (copy).csv").write_text("filter\n")
    (folder / "tables" / ".statistics.csv.123.partial").write_text("of a process that was killed")
    (fault,) = engine.verify(folder).faults
    assert "statistics (copy).csv: the run did not write this file" in fault


def test_a_table_forged_with_its_checksum_does_not_follow_from_the_sums(folder):
    table = Results(folder).table("statistics")
    table.loc[3, "value"] = np.nextafter(table.loc[3, "value"], np.inf)
    write_table(folder / "tables", "statistics", table)
    rewritten(folder)
    found = engine.verify(folder)
    assert found.same is False
    assert found.faults == (f"{folder}: table statistics: made again from the sums, it is another one",)


@pytest.mark.parametrize("array", ["group_power", "kept_error"])
def test_a_checkpoint_forged_with_its_checksum_does_not_come_out_again(folder, array):
    arrays, facts = RunFolder(folder).load_checkpoint()
    if array == "kept_error":
        arrays[array][..., 9 * 64] = np.nextafter(arrays[array][..., 9 * 64], np.inf)
    else:
        arrays[array][9] = np.nextafter(arrays[array][9], np.inf)
    RunFolder(folder).save_checkpoint(arrays, **facts)
    rewritten(folder)
    assert any("block 9: " in fault for fault in engine.verify(folder, 9).faults)
    assert not any("block" in fault for fault in engine.verify(folder, 8).faults)


def test_with_other_software_digits_may_differ_and_that_is_no_damage(folder):
    arrays, facts = RunFolder(folder).load_checkpoint()
    arrays["group_power"][9] = np.nextafter(arrays["group_power"][9], np.inf)
    RunFolder(folder).save_checkpoint(arrays, **facts)
    rewritten(folder, fingerprint={**facts["fingerprint"], "jaxlib": "0.0.1"})
    found = engine.verify(folder, 9)
    assert found.faults == ()
    assert found.same is False
    assert "jaxlib: 0.0.1 then" in found.remarks[0]


def test_an_own_system_is_checked_as_far_as_its_files_go(tmp_path):
    system = nb.System(
        lambda t, x: -x,
        lambda t, x: x,
        [[1.0]],
        nb.Moments([0.0], [[1.0]]),
    )
    stated = {"experiment": "mine", "filters": ["ekf"], "time": {"end": 0.2, "step": 0.1, "output": 0.1}}
    results = nb.run({**stated, "system": system, "monte_carlo": {"runs": 64}}, tmp_path)
    found = engine.verify(results)
    assert (found.faults, found.block) == ((), None)
    assert "exists in Python only" in found.remarks[0]


def test_an_unfinished_run_and_a_block_that_there_is_not_are_refused(folder):
    with pytest.raises(ConfigError, match="--block: got 16; the run has blocks 0 to 15"):
        engine.verify(folder, 16)
    (folder / "DONE").unlink()
    with pytest.raises(EnvironmentFault, match="not finished"):
        engine.verify(folder)


def test_the_command_says_which_block_it_took_and_what_was_the_same(folder):
    done = CliRunner().invoke(app, ["verify", str(folder), "--block", "3"])
    assert done.exit_code == 0
    assert "block   3; with its group, 2 blocks computed again" in done.stdout
    assert "the same to the last bit" in done.stdout
    assert max(map(len, done.stdout.splitlines()[1:-3])) <= 80
