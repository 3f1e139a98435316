"""Claim: what a finished run says of its claims follows the file, and not one run is computed again for it."""

from __future__ import annotations

import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests.small_runs import experiment, table_bytes

CLAIM = {"id": "C1", "says": "better", "statistic": "rms", "less": ["exact", "third-order-guarded"]}
OTHER = {"id": "C2", "says": "small", "statistic": "rms_clipped", "of": ["exact"], "below": 10.0, "at": [0.6]}
SOURCE = {"document": "somewhere", "figures": ["1"], "runs": 33}


@pytest.fixture
def refused(monkeypatch):
    """A run that would compile anything fails."""

    def compile_chunks(*_):
        raise AssertionError("compiled")

    monkeypatch.setattr("nlbench.engine.driver.compile_chunks", compile_chunks)


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    return nb.run(experiment(claims=[CLAIM], source=SOURCE), tmp_path_factory.mktemp("out"))


def test_verdicts_and_shares_of_sets_stand_in_tables(done):
    claims, sets = done.table("claims"), done.table("sets")
    assert claims["id"].tolist() == ["C1"]
    assert sets["runs"].tolist() == [10, 20, 33, 80]
    assert ((sets["share"] >= 0) & (sets["share"] <= 1)).all()


def test_changed_claims_are_judged_from_the_saved_tables(done, refused):
    root = done.path.parents[1]
    before = table_bytes(done.path)
    changed = experiment(claims=[OTHER], source={**SOURCE, "runs": 5}, figures=["rms"])
    after = nb.run(changed, root)
    assert after.path == done.path
    assert after.table("claims")[["id", "verdict"]].to_numpy().tolist() == [["C2", "confirmed"]]
    assert after.table("sets")["runs"].tolist() == [5, 10, 20, 80]
    assert after.experiment == changed
    assert not after.damaged()
    assert table_bytes(after.path) == before
    none = nb.run(experiment(), root)
    assert "claims" not in none.tables
    assert not list((none.path / "tables").glob("sets*"))
    again = nb.run(experiment(claims=[CLAIM], source=SOURCE), root)
    assert again.table("claims").equals(done.table("claims"))
    assert again.table("sets").equals(done.table("sets"))


def test_the_runs_that_there_are_are_not_forgotten_when_claims_change(done, refused):
    fewer = experiment(claims=[OTHER], monte_carlo={"runs": 100, "seed": 11})
    after = nb.run(fewer, done.path.parents[1])
    assert after.manifest["runs"] == after.experiment.monte_carlo.runs == 1000


def test_a_claim_about_a_coordinate_or_a_moment_that_there_is_not_is_refused_before_anything_runs(tmp_path):
    wrong = [
        {**CLAIM, "coordinate": "y"},
        {"id": "C3", "says": "so", "statistic": "moment_actual", "of": ["exact"], "printed": {"1,2": 1.0}},
    ]
    with pytest.raises(ConfigError) as told:
        nb.run(experiment(claims=wrong), tmp_path)
    assert "claims.0.coordinate: 'C1' is about the coordinate 'y', which the system does not have" in str(
        told.value
    )
    assert "claims.1.printed: 'C3' is about the moment '1,2', which the system does not have" in str(
        told.value
    )
    assert not list(tmp_path.iterdir())
