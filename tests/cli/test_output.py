"""Claim: numbers are printed with the digits that their uncertainty supports, and text fits a terminal."""

from __future__ import annotations

import io

import pytest

from nlbench.cli import output
from nlbench.cli.progress import progress


@pytest.mark.parametrize(
    ("value", "stderr", "text"),
    [
        (0.1234, 0.0012, "0.1234(12)"),
        (0.12344, 0.000999, "0.1234(10)"),
        (12.3456, 0.5, "12.35(50)"),
        (1234.5, 12.0, "1234(12)"),
        (123456.0, 1200.0, "1.235(12)e+5"),
        (1.2345e-9, 1.2e-11, "1.234(12)e-9"),
        (0.5, 0.0, "0.5"),
        (0.5, float("nan"), "0.5"),
        (float("nan"), float("nan"), "FAILED"),
        (float("inf"), 1.0, "infinite"),
    ],
)
def test_a_number_carries_its_standard_error(value, stderr, text):
    assert output.uncertain(value, stderr) == text


@pytest.mark.parametrize(
    ("fraction", "text"),
    [
        (0.00037, "0.037"),
        (0.00051, "0.051"),
        (0.0, "0"),
        (1.0, "100"),
        (0.1234, "12.3"),
        (0.0123, "1.2"),
        (1e-7, "0.000010"),
    ],
)
def test_a_percentage_has_two_digits(fraction, text):
    assert output.percent(fraction) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.003, "3 ms"), (2.0, "2.0 s"), (150, "2.5 min"), (7200, "2.0 h"), (864000, "10.0 days")],
)
def test_a_duration_is_said_as_a_person_would(seconds, text):
    assert output.duration(seconds) == text


def test_definitions_fit_eighty_columns(capsys):
    output.definitions([("name", "word " * 60), ("a name that is longer than the column for names", "text")])
    assert max(map(len, capsys.readouterr().out.splitlines())) <= 80


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_colour_needs_a_terminal_and_consent(monkeypatch):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    assert output.styled("x", "red", Terminal()) == "\033[31mx\033[0m"
    assert output.styled("x", "red", io.StringIO()) == "x"
    monkeypatch.setenv("NO_COLOR", "1")
    assert output.styled("x", "red", Terminal()) == "x"


def test_progress_without_a_terminal_is_a_plain_line_now_and_then(capsys, monkeypatch):
    clock = iter([0.0, 1.0, 11.0, 12.0, 23.0, 40.0])
    monkeypatch.setattr("time.monotonic", lambda: next(clock))
    with progress() as show:
        for done in (0, 100, 200, 300, 400):
            show(done, 400)
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["100 of 400 runs (25 %), about 30.0 s left", "300 of 400 runs (75 %), about 7.3 s left"]
