"""Claim: a folder removed in the middle of a run is made anew from what is in memory, or the run says what happened."""

from __future__ import annotations

import logging
import shutil

import pandas as pd
import pytest

import nlbench as nb
from nlbench.engine import finish, resume
from nlbench.errors import EnvironmentFault, LockedError
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from tests.faults.quick import small
from tests.small_runs import table_bytes

pytestmark = pytest.mark.usefixtures("quick")


class Once:
    """Progress that does something as soon as 128 runs are done."""

    def __init__(self, action):
        self.action = action

    def __call__(self, done, total):
        if self.action and done >= 128:
            action, self.action = self.action, None
            action()


@pytest.fixture
def often(monkeypatch):
    """A checkpoint after every call."""
    monkeypatch.setattr(resume, "SECONDS_BETWEEN_CHECKPOINTS", 0.0)
    monkeypatch.setattr(resume, "CHECKPOINT_SHARE", 0.0)


@pytest.mark.usefixtures("often")
def test_it_is_made_anew_and_nothing_is_lost(undisturbed, tmp_path, caplog):
    with caplog.at_level(logging.WARNING, logger="nlbench"):
        results = nb.run(small(), tmp_path, progress=Once(lambda: shutil.rmtree(tmp_path / "small")))
    assert f"{results.path} was removed while the run was using it" in caplog.text
    assert table_bytes(results.path) == table_bytes(undisturbed)
    assert not Results(results.path).damaged()
    assert "config.resolved.yaml" in results.manifest["checksums"]


@pytest.mark.usefixtures("often")
def test_another_run_that_began_there_meanwhile_is_left_alone(undisturbed, tmp_path):
    folder = RunFolder(tmp_path / "small" / undisturbed.name)
    other = folder.locked()

    def replaced():
        shutil.rmtree(tmp_path / "small")
        other.__enter__()

    try:
        with pytest.raises(LockedError, match="is in use by process"):
            nb.run(small(), tmp_path, progress=Once(replaced))
    finally:
        other.__exit__(None, None, None)
    assert [path.name for path in folder.path.iterdir()] == [".lock"]


def test_among_the_tables_it_is_named_and_the_same_command_starts_again(undisturbed, tmp_path, monkeypatch):
    def removed(*given):
        shutil.rmtree(tmp_path / "small")
        return pd.DataFrame({"filter": ["any"]})

    with monkeypatch.context() as patch:
        patch.setattr(finish, "cost_table", removed)
        with pytest.raises(EnvironmentFault, match=f"{undisturbed.name} was removed or replaced") as caught:
            nb.run(small(engine={"chunk": 1, "threads": 2, "cost": True}), tmp_path)
    assert caught.value.exit_code == 5
    assert table_bytes(nb.run(small(), tmp_path).path) == table_bytes(undisturbed)


def test_a_table_that_goes_missing_is_not_left_out_in_silence(tmp_path, monkeypatch):
    write_tables = RunFolder.write_tables

    def one_lost(folder, tables):
        write_tables(folder, tables)
        (folder.path / "tables" / "paired.csv").unlink()

    monkeypatch.setattr(RunFolder, "write_tables", one_lost)
    with pytest.raises(EnvironmentFault, match=r"paired\.csv was removed or changed"):
        nb.run(small(), tmp_path)
