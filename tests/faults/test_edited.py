"""Claim: what was edited in the folder of a run is not believed, and what another version wrote is not mixed in."""

from __future__ import annotations

import logging
import re

import pytest

import nlbench as nb
from nlbench.errors import EnvironmentFault
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from tests.faults.quick import small
from tests.small_runs import table_bytes

CLAIM = {"id": "C1", "says": "none is lost", "statistic": "diverged", "of": ["third-order"], "below": 0.5}
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


def test_a_number_that_json_does_not_have_is_damage(undisturbed, tmp_path, caplog):
    path = nb.run(small(), tmp_path).path
    manifest = path / "manifest.json"
    manifest.write_text(re.sub('"seconds": [0-9.]+', '"seconds": NaN', manifest.read_text()))
    assert "not a manifest that can be read" in Results(path).damaged()[0]
    again = nb.run(small(), tmp_path)
    assert table_bytes(again.path) == table_bytes(undisturbed)


def test_what_others_put_among_the_tables_is_neither_read_nor_in_the_way(undisturbed, tmp_path):
    tables = RunFolder(nb.run(small(), tmp_path).path).path / "tables"
    (tables / ".ipynb_checkpoints").mkdir()
    (tables / "mine.parquet").write_bytes((tables / "statistics.parquet").read_bytes())
    (tables.parent / "DONE").unlink()
    again = nb.run(small(), tmp_path)
    assert "mine" not in again.tables
    assert again.damaged() == []
    assert [each for each in again.unknown() if "mine.parquet" in each]
    claimed = nb.run(small(claims=[CLAIM]), tmp_path)  # read anew, nothing computed
    assert "claims" in claimed.tables
    assert "mine" not in claimed.tables
    assert claimed.damaged() == []


def test_fewer_runs_than_there_are_change_nothing_and_are_not_claimed(tmp_path):
    path = nb.run(small(), tmp_path).path
    (path / "tables" / "paired.csv").write_text("edited")
    again = nb.run(small(monte_carlo={"runs": 100, "seed": 11}), tmp_path)
    assert again.manifest["runs"] == again.experiment.monte_carlo.runs == 1000
