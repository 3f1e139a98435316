"""Claim: a report is made of what the run wrote, or not at all."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench.cli.app import app
from tests.small_runs import experiment


@pytest.fixture
def folder(tmp_path):
    return nb.run(experiment(reference=None, filters=["ekf"], monte_carlo={"runs": 200}), tmp_path).path


@pytest.mark.parametrize("name", ["statistics.csv", "paired.parquet"])
def test_an_edited_or_missing_table_is_named(folder, name):
    file = folder / "tables" / name
    file.write_bytes(file.read_bytes() + b" ")
    edited = CliRunner().invoke(app, ["report", str(folder)])
    file.unlink()
    missing = CliRunner().invoke(app, ["report", str(folder)])
    for done in (edited, missing):
        assert done.exit_code == 5
        assert name in done.output
    assert not (folder / "report.html").exists()


def test_an_unfinished_run_has_no_report(folder):
    (folder / "DONE").unlink()
    done = CliRunner().invoke(app, ["report", str(folder)])
    assert done.exit_code == 5
    assert "not finished" in done.output
