"""Claim: a run that is killed at random moments and resumed each time has the tables of one that nothing disturbed."""

from __future__ import annotations

import pytest

from tests.faults.kills import ROOT, killed


@pytest.mark.long
def test_twenty_kills_at_random_moments_change_no_byte(tmp_path):
    found = killed(tmp_path, ROOT / "configs" / "quickstart.yaml", 100_000, kills=20, seed=1)
    assert len(found.signals) == 20
    assert len({name for name, _ in found.signals}) == 3
    assert len(found.undisturbed) > 10
    assert all(each == found.undisturbed for each in found.resumed)
