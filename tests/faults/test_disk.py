"""Claim: whichever write of a run fails, it is named, nothing is half written, and the same command finishes."""

from __future__ import annotations

import os

import pytest

import nlbench as nb
from nlbench.errors import EnvironmentFault
from nlbench.results.checkpoint import load_checkpoint
from nlbench.results.folder import CHECKPOINT
from tests.faults.quick import BROKEN, FULL, READ_ONLY, FailingDisk, left_over, small
from tests.small_runs import table_bytes

pytestmark = pytest.mark.usefixtures("quick")


@pytest.fixture(scope="module")
def syncs(program, tmp_path_factory):
    """How many times an undisturbed run waits for the disk: twice for each file, before and after its name is given."""
    from tests.faults.quick import made_quick

    with pytest.MonkeyPatch.context() as patch:
        made_quick(patch, program)
        patch.setattr(os, "fsync", disk := FailingDisk())
        files = [
            p for p in nb.run(small(), tmp_path_factory.mktemp("counted")).path.rglob("*") if p.is_file()
        ]
    assert disk.calls == 2 * (len(files) - 1)  # every file but the lock went through atomic_write
    return disk.calls


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.long)])
def test_every_write_may_fail_in_turn(undisturbed, syncs, tmp_path, monkeypatch, every):
    whole = {p.relative_to(undisturbed): p.read_bytes() for p in undisturbed.rglob("*") if p.is_file()}
    for fail in range(0, syncs, every):
        number = (FULL, BROKEN, READ_ONLY)[fail % 3]
        out = tmp_path / str(fail)
        with monkeypatch.context() as patch:
            patch.setattr(os, "fsync", FailingDisk(fail, number))
            with pytest.raises(EnvironmentFault, match=r"cannot write .*; needed .*; free ") as caught:
                nb.run(small(), out)
        assert os.strerror(number) in str(caught.value)
        folder = out / undisturbed.parent.name / undisturbed.name
        assert not left_over(out)
        for path in (path for path in folder.rglob("*") if path.is_file()):
            name = path.relative_to(folder)
            if str(name) == CHECKPOINT:
                load_checkpoint(path)
            elif name.suffix in (".csv", ".parquet", ".yaml"):
                assert path.read_bytes() == whole[name], f"{name} after write {fail} failed"
        assert table_bytes(nb.run(small(), out).path) == table_bytes(undisturbed)


@pytest.mark.parametrize("fail", [2, 20])
def test_a_process_that_dies_while_it_writes_is_resumed(undisturbed, tmp_path, monkeypatch, fail):
    """As a KeyboardInterrupt, which nobody saves anything for."""
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", FailingDisk(fail, error=KeyboardInterrupt()))
        with pytest.raises(KeyboardInterrupt):
            nb.run(small(), tmp_path)
    assert table_bytes(nb.run(small(), tmp_path).path) == table_bytes(undisturbed)


def test_a_checkpoint_that_may_not_be_read_is_no_reason_to_begin_again(undisturbed, tmp_path, monkeypatch):
    from nlbench.results import checkpoint

    path = nb.run(small(), tmp_path).path
    (path / "DONE").unlink()
    before = (path / CHECKPOINT).read_bytes()

    def refuse(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(checkpoint.np, "load", refuse)
    with pytest.raises(EnvironmentFault, match=r"checkpoint\.npz: cannot be read \(Permission denied\)"):
        nb.run(small(), tmp_path)
    assert (path / CHECKPOINT).read_bytes() == before


def test_results_that_were_made_may_be_topped_up_after_a_full_disk(undisturbed, tmp_path, monkeypatch):
    """The finished run stays what it was until the first file of the longer one is written."""
    more = small(monte_carlo={"runs": 2000, "seed": 11})
    path = nb.run(small(), tmp_path).path
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", FailingDisk(3))
        with pytest.raises(EnvironmentFault):
            nb.run(more, tmp_path)
    assert not (path / "DONE").exists()
    straight = nb.run(more, tmp_path / "straight").path
    assert table_bytes(nb.run(more, tmp_path).path) == table_bytes(straight)
