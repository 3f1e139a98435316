"""Claim: whatever is done to an experiment file, `validate` ends with 0 or 2, in plain words, and writes nothing."""

from __future__ import annotations

import pytest

from nlbench.errors import Problem
from tests.input.answers import answer
from tests.input.mutants import main, mutant, wrong

SECONDS = 10.0  # for one file, on a busy machine; the largest of configs/ takes a tenth


@pytest.mark.parametrize("number", range(80))
def test_a_spoiled_file_is_answered_in_plain_words(tmp_path, number):
    path = tmp_path / "mutant.yaml"
    path.write_bytes(mutant(number))
    given = answer("validate", path)
    assert wrong(path, given, [path.name]) == [], given.said[-2000:]
    assert given.seconds < SECONDS


@pytest.mark.long
def test_ten_thousand_spoiled_files_are_answered_in_plain_words(capsys):
    assert main(10_000, 2026) == 0, capsys.readouterr().out


def test_a_message_repeats_no_value_of_thousands_of_characters():
    said = str(Problem(f"no filter is labelled '{'9' * 5000}', here", "claims.0.less", "a.yaml", 3, 5))
    assert said.startswith("a.yaml:3:5: claims.0.less: no filter is labelled '999")
    assert said.endswith("', here")
    assert len(said) < 1000
    assert len(str(Problem("\u2028" * 800, "a", "a.yaml"))) < 1000  # each is shown as six characters


def test_a_message_cannot_command_the_terminal():
    assert str(Problem("got '\x1b[31m\ud7ff\u202e'", "x")) == "x: got '\\x1b[31m\\ud7ff\\u202e'"
