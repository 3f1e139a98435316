"""Claim: a CSV file of measurements is read as it stands, or everything wrong with it is said, each with its line."""

from __future__ import annotations

import math

import pytest

from nlbench.config import recording
from nlbench.errors import ConfigError
from tests.example import written

GOOD = "time,range,bearing\n0.1,5.25,1e-3\n0.2,,NaN\n0.2,na,-2\n"


def read(tmp_path, text, **options):
    return recording.read(written(tmp_path, text, "data.csv"), **options)


def complaints(tmp_path, text, **options):
    """What is wrong, without the folder."""
    with pytest.raises(ConfigError) as refused:
        read(tmp_path, text, **options)
    return [str(problem).replace(f"{tmp_path}/", "") for problem in refused.value.problems]


def test_an_empty_field_nan_and_na_mean_not_measured(tmp_path):
    found = read(tmp_path, GOOD)
    assert found.names == ("range", "bearing")
    assert list(found.times) == [0.1, 0.2, 0.2]
    assert [None if math.isnan(value) else value for value in found.values] == [
        5.25, 1e-3, None, None, None, -2,
    ]  # fmt: skip
    assert list(found.lines) == [2, 3, 4]


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbf" + GOOD.encode(),
        GOOD.replace("\n", "\r\n"),
        GOOD.replace(",", " , "),
        GOOD.replace("range", '"range"').replace("5.25", '"5.25"'),
        GOOD.rstrip("\n"),
    ],
    ids=["byte order mark", "carriage returns", "spaces", "quotes", "no last newline"],
)
def test_what_spreadsheets_write_is_read_alike(tmp_path, text):
    found, usual = read(tmp_path, text), read(tmp_path, GOOD)
    assert (found.names, found.times, found.lines) == (usual.names, usual.times, usual.lines)
    assert repr(found.values) == repr(usual.values)


def test_blank_lines_are_passed_over_and_counted(tmp_path):
    assert list(read(tmp_path, "time,y\n\n1,2\n\n3,4\n").lines) == [3, 5]


def test_columns_are_taken_by_name_in_the_order_asked_for(tmp_path):
    found = read(tmp_path, "b,t,note,a\n1,10,good,2\n3,11,,4\n", time="t", measured=["a", "b"])
    assert (list(found.times), list(found.values)) == ([10, 11], [2, 1, 4, 3])


def test_large_times_keep_every_digit_that_a_double_holds(tmp_path):
    found = read(tmp_path, "time,y\n1700000000.125,1\n1700000000.25,2\n")
    assert list(found.times) == [1700000000.125, 1700000000.25]


def test_times_that_a_double_cannot_tell_apart_are_refused(tmp_path):
    text = "time,y\n1700000000123456788,1\n1700000000123456789,2\n"
    assert complaints(tmp_path, text) == [
        "data.csv:3: time: 1700000000123456789 and 1700000000123456788 of line 2 are one number in double precision; "
        "subtract a start from all"
    ]
    assert len(read(tmp_path, "time,y\n1,1\n1.0,2\n").times) == 2
    (said,) = complaints(tmp_path, "time,y\n0,1\n1e-99999999999999999999,2\n")
    assert said.startswith("data.csv:3: time: 1e-99999999999999999999 and 0 of line 2 are one number")


def test_everything_wrong_with_the_rows_is_said_at_once(tmp_path):
    text = "time,a,b\n0,1,2\n1,x,1_0\n,1,2\n3,inf,4\n2,5,6\n4,5\n5,\u0663,1\nnan,1,2\n"
    assert complaints(tmp_path, text) == [
        "data.csv:3: a: expected a finite number, found 'x'",
        "data.csv:3: b: expected a finite number, found '1_0'",
        "data.csv:4: time: expected a time, found nothing",
        "data.csv:5: a: expected a finite number, found 'inf'",
        "data.csv:6: time: 2 comes after 3 of line 5; times must not descend",
        "data.csv:7: expected 3 fields, found 2",
        "data.csv:8: a: expected a finite number, found '\u0663'",
        "data.csv:9: time: expected a time, found 'nan'",
    ]


def test_many_wrong_rows_are_counted(tmp_path):
    said = complaints(tmp_path, "time,y\n" + "x,1\n" * 1234)
    assert len(said) == recording.MOST_SHOWN + 1
    assert said[-1] == "data.csv: 1,214 more entries are wrong"


def test_steps_are_whole_numbers(tmp_path):
    assert list(read(tmp_path, "time,y\n1,2\n3.0,4\n", whole=True).times) == [1, 3]
    (said,) = complaints(tmp_path, "time,y\n1,2\n1.5,4\n", whole=True)
    assert said.startswith("data.csv:3: time: expected a step number")


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        ("", {}, "data.csv: no header in the first line; expected one such as time,y"),
        ("\n", {}, "data.csv: no header in the first line; expected one such as time,y"),
        ("time,y\n", {}, "data.csv: no row of data below the header"),
        ("Time,y\n1,2\n", {}, "data.csv:1: no column 'time'; did you mean 'Time'? (--time names it)"),
        ("time;y\n1;2\n", {}, "data.csv:1: no column 'time'; fields are separated by commas, not by ';' (--time"),
        ("time,y,y\n1,2,3\n", {}, "data.csv:1: the column 'y' stands 2 times"),
        ("time\n1\n", {}, "data.csv:1: no column beside 'time': nothing was measured"),
        ("time,range\n1,2\n", {"measured": ["rnage"]}, "did you mean 'range'?"),
        ("time,y\n1,2\n", {"measured": ["y", "y"]}, "data.csv:1: the measurement 'y' is named 2 times"),
        ("time,y\n1,2\n", {"measured": ["time"]}, "data.csv:1: no column 'time' to measure"),
        (b"time,y\n1,\xff2\n", {}, "data.csv:2:3: not text in UTF-8"),
        ("time,y\n1,2\n".encode("utf-16"), {}, "data.csv:1"),
        (b"time,y\n1,\x002\n", {}, "data.csv:2: a binary file"),
        ('time,y\n1,"2\n', {}, "data.csv:2: not a table of comma-separated values"),
        ("time,y\n1," + "2" * 1_000_000, {}, "data.csv:2: longer than 1,000,000 bytes"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_recording_is_refused(tmp_path, text, options, says):
    (said,) = complaints(tmp_path, text, **options)
    assert says in said


def test_rows_before_a_line_that_cannot_be_read_are_told_too(tmp_path):
    said = complaints(tmp_path, b"time,y\nx,2\n1,\xff\n")
    assert said == ["data.csv:2: time: expected a time, found 'x'", "data.csv:3:3: not text in UTF-8"]


def test_a_file_of_more_rows_than_memory_should_hold_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "MOST_ROWS", 3)
    (said,) = complaints(tmp_path, "time,y\n" + "1,2\n" * 4)
    assert said.startswith("data.csv: more than 3 rows")


def test_a_file_that_is_not_there_is_said_to_be(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.csv: cannot read the data: no such file"):
        recording.read(tmp_path / "none.csv")
    with pytest.raises(ConfigError, match="cannot read the data: is a directory"):
        recording.read(tmp_path)
