"""Claims: an interrupted run goes on where it was; what is damaged is noticed and made anew; nothing is mixed."""

from __future__ import annotations

import logging
import shutil
import signal

import pytest

import nlbench as nb
from nlbench.engine import driver
from nlbench.errors import EnvironmentFault, Interrupted, LockedError
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from tests.small_runs import experiment, python, table_bytes


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return nb.run(experiment(), tmp_path_factory.mktemp("finished")).path


@pytest.fixture
def done(finished, tmp_path):
    """A copy of the finished run, to be spoiled."""
    return Results(shutil.copytree(finished, tmp_path / finished.parent.name / finished.name))


class InterruptOnce:
    """Progress that raises SIGINT the first time that something, but not everything, is done."""

    def __init__(self):
        self.due = True

    def __call__(self, done, total):
        if self.due and 0 < done < total:
            self.due = False
            signal.raise_signal(signal.SIGINT)


def test_ctrl_c_saves_and_the_same_command_goes_on(done, tmp_path):
    other = experiment(engine={"chunk": 1, "threads": 1})
    with pytest.raises(Interrupted, match="the same command goes on"):
        nb.run(other, tmp_path / "other", progress=InterruptOnce())
    folder = next((tmp_path / "other").rglob("checkpoint.npz")).parents[1]
    assert not (folder / "DONE").exists()
    seen = []
    resumed = nb.run(other, tmp_path / "other", progress=lambda runs, total: seen.append(runs))
    assert seen[0] > 0
    assert table_bytes(resumed.path) == table_bytes(done.path)


def test_ctrl_c_while_compiling_stops_before_anything_is_computed(tmp_path, monkeypatch):
    compile_chunks = driver.compile_chunks

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        return compile_chunks(*arguments)

    monkeypatch.setattr(driver, "compile_chunks", interrupted)
    with pytest.raises(Interrupted, match="stopped after 0 of 1,000 runs"):
        nb.run(experiment(), tmp_path)


def test_a_finished_run_is_not_computed_again(done, tmp_path, monkeypatch):
    monkeypatch.setattr(driver, "compile_chunks", None)  # calling it would raise
    assert nb.run(experiment(), tmp_path).path == done.path


@pytest.mark.parametrize(
    "name", ["tables/statistics.csv", "tables/paired.parquet", "batches/checkpoint.npz", "manifest.json"]
)
def test_a_damaged_file_is_named_and_made_anew(done, tmp_path, caplog, name):
    before = table_bytes(done.path)
    file = done.path / name
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 1
    file.write_bytes(data)
    with caplog.at_level(logging.WARNING, logger="nlbench"):
        again = nb.run(experiment(), tmp_path)
    assert file.name in caplog.text
    assert not again.damaged()
    assert table_bytes(again.path) == before


def test_a_checkpoint_of_other_software_is_refused(done, tmp_path):
    folder = RunFolder(done.path)
    arrays, facts = folder.load_checkpoint()
    facts["fingerprint"]["jaxlib"] = "0.0.1"
    folder.save_checkpoint(arrays, **facts)
    with pytest.raises(EnvironmentFault, match=r"jaxlib: 0\.0\.1 then"):
        nb.run(experiment(monte_carlo={"runs": 2000, "seed": 11}), tmp_path)
    assert folder.done_runs() == 1000  # what was finished stays so


def test_a_folder_in_use_is_refused(done, tmp_path):
    program = "import sys, nlbench as nb\nfrom tests.small_runs import experiment\nnb.run(experiment(), sys.argv[1])"
    with RunFolder(done.path).locked():
        other = python(program, str(tmp_path))
    assert LockedError.__name__ in other.stderr
