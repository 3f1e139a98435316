"""Claim: what was edited in the folder of a run is not believed, and what another version wrote is not mixed in."""

from __future__ import annotations

import logging

import pytest

import nlbench as nb
from nlbench.errors import EnvironmentFault
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from tests.faults.quick import small
from tests.small_runs import table_bytes

pytestmark = pytest.mark.usefixtures("quick")


def test_a_mark_that_says_other_runs_than_the_manifest_is_written_anew(undisturbed, tmp_path, caplog):
    path = nb.run(small(), tmp_path).path
    (path / "DONE").write_text("1000000000\n")
    assert "says 1,000,000,000 runs, the manifest 1,000" in Results(path).damaged()[0]
    with caplog.at_level(logging.WARNING, logger="nlbench"):
        again = nb.run(small(), tmp_path)
    assert "says 1,000,000,000 runs" in caplog.text
    assert table_bytes(again.path) == table_bytes(undisturbed)
    assert not again.damaged()


def test_a_checkpoint_of_another_schema_is_named_and_stays(tmp_path):
    folder = RunFolder(nb.run(small(), tmp_path).path)
    arrays, facts = folder.load_checkpoint()
    folder.save_checkpoint(arrays, **{**facts, "schema": 1})
    before = (folder.path / "batches" / "checkpoint.npz").read_bytes()
    with pytest.raises(
        EnvironmentFault, match=r"checkpoint\.npz: schema 1, this version of nlbench writes schema 2"
    ):
        nb.run(small(monte_carlo={"runs": 2000, "seed": 11}), tmp_path)
    assert (folder.path / "batches" / "checkpoint.npz").read_bytes() == before
