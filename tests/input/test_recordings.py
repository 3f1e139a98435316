"""Claim: recorded data spoiled at random are read as what they say, or refused in plain words with their lines."""

from __future__ import annotations

import csv
import io
import itertools
import math
import random

import pytest

from nlbench.config import recording
from nlbench.errors import ConfigError
from tests.input.answers import LONGEST_LINE, answer, faults
from tests.input.spoiling import TEXTS, spoiled

EXPERIMENT = """# Recorded data
experiment: recorded
system: {name: oscillator, measurement_variance: 2.0}
filters: [ekf]
"""
SOUND, REFUSED, FAILED = 0, 2, 4


def data(number):
    """A table of measurements, some of them missing, spoiled."""
    chance = random.Random(f"1969/{number}")
    rows = [
        f"{0.2 * k:.1f},{chance.gauss(0, 10):.3f},{chance.choice(['', 'NaN', '-1.5e0'])}"
        for k in range(1, 20)
    ]
    return spoiled(chance, "\n".join(["time,position,velocity", *rows, ""]), TEXTS)


def numbers(content):
    """Times and measurements of a table as Python's own reader has them, NaN for what is missing."""
    rows = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), skipinitialspace=True)
    header = [each.strip() for each in next(rows)]
    at = header.index("time")
    table = [
        [math.nan if not each.strip() or each.strip().lower() == "na" else float(each) for each in row]
        for row in rows
        if row
    ]
    return [row.pop(at) for row in table], [value for row in table for value in row]


def wrong(path):
    """What is wrong with how a file is read."""
    try:
        found = recording.read(path)
    except ConfigError as error:
        said = str(error)
        plain = all(each.isprintable() or each == "\n" for each in said)
        short = max(map(len, said.split("\n"))) <= LONGEST_LINE
        return [] if plain and short and path.name in said else [said]
    times, values = numbers(path.read_bytes())
    same = list(found.times) == times and repr(list(found.values)) == repr(values)
    in_order = all(a <= b for a, b in itertools.pairwise(times))
    return [] if same and in_order and all(map(math.isfinite, times)) else [repr(found)]


@pytest.mark.parametrize("first", range(0, 1000, 100))
def test_a_file_is_read_as_what_it_says_or_refused_in_plain_words(tmp_path, first):
    path = tmp_path / "data.csv"
    for number in range(first, first + 100):
        path.write_bytes(data(number))
        assert wrong(path) == [], number


def test_the_command_ends_with_estimates_or_plain_words_and_writes_no_file(tmp_path):
    path, config = tmp_path / "data.csv", tmp_path / "recorded.yaml"
    config.write_text(EXPERIMENT)
    answered = []
    for number in range(2000, 2030):
        path.write_bytes(data(number))
        given = answer("filter", config, path)
        answered.append(given.code)
        assert faults(given, (SOUND, REFUSED, FAILED), path.name) == [], (number, given.said[-1000:])
        assert sorted(each.name for each in tmp_path.iterdir()) == [path.name, config.name]
    assert {SOUND, REFUSED} <= set(answered)
