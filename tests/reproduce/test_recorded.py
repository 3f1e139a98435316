"""Claim: a verdict that is not the recorded one is found, and only verdicts on the same runs are compared."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from nlbench.errors import DamagedResults
from nlbench.reproduce import recorded
from nlbench.reproduce.verdicts import CLAIMS_ONLY, DIFFERS


def summary(verdicts, runs=2048, mode="quick", state="done"):
    """As much of a summary as is recorded: entries by number."""
    entries = [
        SimpleNamespace(document="culver-1969", name=name, verdict=verdict, experiments=("a", "b"))
        for name, verdict in verdicts.items()
    ]
    experiments = {name: SimpleNamespace(runs=runs, state=state) for name in ("a", "b")}
    return SimpleNamespace(mode=mode, entries=entries, experiments=experiments)


FIRST = {"figure 7.1": CLAIMS_ONLY, "figure 7.2": DIFFERS}


def test_what_is_recorded_is_found_again(tmp_path):
    path = tmp_path / "deep" / recorded.NAME
    assert recorded.record(summary(FIRST), path) == 2
    assert recorded.compare(summary(FIRST), path) == (2, (), 0, 0)


def test_a_changed_verdict_is_told_before_and_after(tmp_path):
    path = tmp_path / recorded.NAME
    recorded.record(summary(FIRST), path)
    found = recorded.compare(summary({**FIRST, "figure 7.2": CLAIMS_ONLY}), path)
    ((before, now),) = found.changed
    assert (before.verdict, now.verdict, now.entry) == (DIFFERS, CLAIMS_ONLY, "figure 7.2")
    assert found.same == 1


def test_other_numbers_of_runs_modes_and_entries_are_not_compared(tmp_path):
    path = tmp_path / recorded.NAME
    recorded.record(summary(FIRST), path)
    assert recorded.compare(summary(FIRST, runs=4096), path) == (0, (), 2, 0)
    assert recorded.compare(summary(FIRST, mode="full"), path) == (0, (), 0, 2)
    assert recorded.compare(summary({"figure 7.3": DIFFERS}), path) == (0, (), 0, 1)


def test_what_was_not_run_is_neither_recorded_nor_compared(tmp_path):
    path = tmp_path / recorded.NAME
    recorded.record(summary(FIRST), path)
    assert recorded.compare(summary(dict.fromkeys(FIRST, "NOT TESTABLE"), state="failed"), path).changed == ()
    assert recorded.record(summary(FIRST, state="failed"), path) == 0


def test_recording_a_part_keeps_the_rest(tmp_path):
    path = tmp_path / recorded.NAME
    recorded.record(summary(FIRST), path)
    recorded.record(summary({"figure 7.2": CLAIMS_ONLY}), path)
    recorded.record(summary(FIRST, mode="full"), path)
    assert [(row.mode, row.entry, row.verdict) for row in recorded.read(path)] == [
        ("quick", "figure 7.1", CLAIMS_ONLY),
        ("quick", "figure 7.2", CLAIMS_ONLY),
        ("full", "figure 7.1", CLAIMS_ONLY),
        ("full", "figure 7.2", DIFFERS),
    ]


def test_a_file_that_is_no_record_is_refused(tmp_path):
    path = tmp_path / recorded.NAME
    path.write_text("mode,verdict\nquick,DIFFERS\n")
    with pytest.raises(DamagedResults, match="not a record"):
        recorded.read(path)
