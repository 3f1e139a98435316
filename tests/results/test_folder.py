"""A run's folder: one writer at a time, done only when everything is there, readable only if undamaged."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from nlbench.config import load
from nlbench.errors import DamagedResults, LockedError
from nlbench.results import fingerprint
from nlbench.results.folder import RunFolder
from nlbench.results.manifest import commit, read_manifest, versions, write_manifest
from nlbench.results.results import Results

TABLE = pd.DataFrame({"filter": ["a", "b"], "time": ["1.0", "all"], "value": [0.1, np.nan], "n": [5, 6]})
TIMES = "time: {end: 2.0, step: 0.02, output: 0.1}\n"


@pytest.fixture
def finished(tmp_path) -> Path:
    folder = RunFolder(tmp_path / "run")
    with folder.locked():
        folder.write_experiment("# Why?\nexperiment: a\n")
        folder.save_checkpoint({"x": np.arange(3)}, seed=1)
        folder.write_tables({"statistics": TABLE, "runs": TABLE})
        folder.finish(500, seed=1969, units={"x": "m"})
    return folder.path


def test_a_finished_folder_has_the_layout_of_the_contract(finished):
    files = {str(path.relative_to(finished)) for path in finished.rglob("*") if path.is_file()}
    assert files == {
        *(".lock", "DONE", "manifest.json", "config.resolved.yaml", "batches/checkpoint.npz"),
        *("tables/statistics.csv", "tables/statistics.parquet", "tables/runs.parquet"),
    }
    assert RunFolder(finished).done_runs() == 500


def test_results_give_back_tables_and_manifest(finished):
    results = Results(finished)
    pd.testing.assert_frame_equal(results.table("statistics"), TABLE)
    assert results.tables == ("runs", "statistics")
    assert (results.manifest["seed"], results.manifest["runs"], results.manifest["units"]) == (
        1969,
        500,
        {"x": "m"},
    )
    assert results.damaged() == []
    assert results.path == finished
    with pytest.raises(KeyError, match="no table 'statistic'; it has runs, statistics"):
        results.table("statistic")


def test_the_experiment_of_a_run_is_the_one_that_was_run(tmp_path):
    file = tmp_path / "file.yaml"
    file.write_text("# Why?\nexperiment: a\nsystem: {name: culver-scalar}\nfilters: [second-order]\n" + TIMES)
    experiment = load(file)
    folder = RunFolder(tmp_path / "run")
    folder.write_experiment(experiment.resolved_yaml())
    folder.write_tables({"statistics": TABLE})
    folder.finish(5)
    assert Results(folder.path).experiment == experiment
    (folder.path / "config.resolved.yaml").write_text(file.read_text())
    with pytest.raises(DamagedResults, match=r"config\.resolved\.yaml"):
        _ = Results(folder.path).experiment


def test_an_edited_table_is_refused_by_name(finished):
    path = finished / "tables" / "statistics.parquet"
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(DamagedResults, match=r"statistics\.parquet") as caught:
        Results(finished).table("statistics")
    assert caught.value.exit_code == 5
    pd.testing.assert_frame_equal(Results(finished).table("runs"), TABLE)


@pytest.mark.parametrize(
    "name", ["tables/statistics.csv", "tables/runs.parquet", "batches/checkpoint.npz", "config.resolved.yaml"]
)
def test_every_file_that_is_changed_or_missing_is_found(finished, name):
    path = finished / name
    path.write_bytes(path.read_bytes()[:-1])
    (changed,) = Results(finished).damaged()
    assert changed.startswith(str(path))
    path.unlink()
    (missing,) = Results(finished).damaged()
    assert missing.startswith(f"{path}: cannot be read")


def test_a_missing_table_is_damage_and_not_an_empty_result(finished):
    (finished / "tables" / "statistics.parquet").unlink()
    with pytest.raises(DamagedResults, match=r"statistics\.parquet"):
        Results(finished).table("statistics")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("1969", "1970"), "checksum"),
        (lambda text: text[:-20], "not a manifest"),
        (lambda text: "[]", "not a manifest"),
        (lambda text: "\x00\xff", "not a manifest"),
    ],
)
def test_an_edited_manifest_is_refused(finished, change, message):
    path = finished / "manifest.json"
    path.write_text(change(path.read_text()))
    with pytest.raises(DamagedResults, match=message):
        Results(finished).table("statistics")


def test_a_manifest_of_another_schema_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("nlbench.results.manifest.SCHEMA", 99)
    write_manifest(tmp_path / "manifest.json", {"runs": 1})
    monkeypatch.undo()
    with pytest.raises(DamagedResults, match="schema 99"):
        read_manifest(tmp_path / "manifest.json")


def test_a_folder_without_a_manifest_is_said_to_be_unfinished(tmp_path):
    with pytest.raises(DamagedResults, match="not finished"):
        Results(tmp_path).table("statistics")


def test_the_mark_goes_before_anything_changes(finished):
    folder = RunFolder(finished)
    folder.reopen()
    assert folder.done_runs() is None
    assert not (finished / "DONE").exists()
    folder.reopen()


def test_a_mark_that_says_no_number_is_damage(finished):
    (finished / "DONE").write_text("")
    with pytest.raises(DamagedResults, match="DONE"):
        RunFolder(finished).done_runs()


def test_the_mark_is_written_last(tmp_path, monkeypatch):
    folder = RunFolder(tmp_path)
    written = []

    def record(path, data):
        written.append(path.name)
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)

    for module in ("folder", "tables", "manifest"):
        monkeypatch.setattr(f"nlbench.results.{module}.atomic_write", record)
    folder.write_experiment("")
    folder.write_tables({"statistics": TABLE})
    folder.finish(5)
    assert written[-2:] == ["manifest.json", "DONE"]


def test_a_checkpoint_that_is_not_there_is_none_and_a_damaged_one_is_named(finished):
    folder = RunFolder(finished)
    arrays, facts = folder.load_checkpoint()
    assert (arrays["x"].tolist(), facts) == ([0, 1, 2], {"seed": 1})
    path = finished / "batches" / "checkpoint.npz"
    path.write_bytes(path.read_bytes()[:50])
    with pytest.raises(DamagedResults, match=r"checkpoint\.npz"):
        folder.load_checkpoint()
    path.unlink()
    assert folder.load_checkpoint() is None


HOLD = """
import sys, time
from nlbench.results.folder import RunFolder
with RunFolder(sys.argv[1]).locked():
    print("held", flush=True)
    sys.stdin.readline()
"""


def holder(path: Path) -> subprocess.Popen:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_process_is_refused_and_told_who_holds_the_folder(tmp_path):
    process = holder(tmp_path)
    try:
        message = rf"process {process.pid} since 20\d\d-"
        with pytest.raises(LockedError, match=message) as caught, RunFolder(tmp_path).locked():
            pass
        assert caught.value.exit_code == 6
    finally:
        process.communicate("\n")
    with RunFolder(tmp_path).locked():
        pass


def test_a_killed_process_leaves_no_lock(tmp_path):
    process = holder(tmp_path)
    process.kill()
    process.communicate()
    (tmp_path / ".lock").write_text("what an earlier holder wrote " * 9)
    with RunFolder(tmp_path).locked():
        assert json.loads((tmp_path / ".lock").read_text())["pid"] == os.getpid()


def test_the_same_process_cannot_hold_a_folder_twice(tmp_path):
    with RunFolder(tmp_path).locked(), pytest.raises(LockedError), RunFolder(tmp_path).locked():
        pass


def test_a_lock_is_released_after_an_error(tmp_path):
    with pytest.raises(RuntimeError), RunFolder(tmp_path).locked():
        raise RuntimeError
    with RunFolder(tmp_path).locked():
        pass


def test_locking_sweeps_half_written_files(tmp_path):
    (tmp_path / "tables").mkdir()
    left = tmp_path / "tables" / ".statistics.csv.123.partial"
    left.write_text("half")
    with RunFolder(tmp_path).locked():
        assert not left.exists()


def test_the_fingerprint_depends_on_features_and_flags_but_not_on_how_work_is_shared(tmp_path, monkeypatch):
    cpuinfo = tmp_path / "cpuinfo"
    cpuinfo.write_text("processor: 0\nflags\t\t: fpu avx2\nflags\t\t: fpu avx2\n")
    monkeypatch.setenv("XLA_FLAGS", "--b --a")
    first = fingerprint.fingerprint(cpuinfo=cpuinfo)
    monkeypatch.setenv("XLA_FLAGS", "--a --xla_force_host_platform_device_count=8 --b")
    assert fingerprint.differences(fingerprint.fingerprint(cpuinfo=cpuinfo), first) == []
    cpuinfo.write_text("flags: fpu avx512f\n")
    monkeypatch.setenv("XLA_FLAGS", "--a")
    changed = fingerprint.differences(fingerprint.fingerprint("gpu", cpuinfo), first)
    assert [line.partition(":")[0] for line in changed] == ["cpu_features", "device", "xla_flags"]


def test_the_fingerprint_tells_kernels_that_the_environment_chooses(monkeypatch):
    monkeypatch.delenv("OPENBLAS_CORETYPE", raising=False)
    usual = fingerprint.fingerprint()
    assert "blas" not in usual
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    changed = fingerprint.differences(fingerprint.fingerprint(), usual)
    assert changed == ["blas: None then, OPENBLAS_CORETYPE=Haswell now"]


def test_the_fingerprint_needs_no_cpuinfo(tmp_path):
    assert fingerprint.fingerprint(cpuinfo=tmp_path / "none")["cpu_features"]


def test_versions_and_commit_say_where_numbers_come_from():
    found = versions()
    assert found["jaxlib"].count(".") == 2
    known = commit()
    assert known is None or len(known.removesuffix("-dirty")) == 40
