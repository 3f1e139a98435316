"""A CSV file of recorded measurements as numbers, or everything that is wrong with it, each with its line."""

from __future__ import annotations

import csv
import math
import os
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import Decimal
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from nlbench.errors import ConfigError, Problem
from nlbench.suggestions import suggestion

MOST_ROWS = 1_000_000
LONGEST_LINE = 1_000_000  # bytes
MOST_SHOWN = 20  # rows that are wrong; the others are counted
MISSING = ("", "nan", "na")


class Recording(NamedTuple):
    """What a file holds.

    file: as the user named it. names: of the m columns that were measured. times: (T,), in the order of the file and
    not descending. values: T x m, row by row, NaN where not measured. lines: (T,), where each row stands, from 1.
    """

    file: str
    names: tuple[str, ...]
    times: array
    values: array
    lines: array


class Columns(NamedTuple):
    """The number of fields in a row, and which of them are the time and the measurements."""

    fields: int
    time: int
    measured: tuple[int, ...]


class Faults:
    """What is wrong with the rows of a file: the first problems, and how many more there are."""

    def __init__(self, file: str) -> None:
        self.file, self.more = file, 0
        self.shown: list[Problem] = []

    def add(self, message: str, line: int, column: str = "") -> None:
        """One more."""
        if len(self.shown) < MOST_SHOWN:
            self.shown.append(Problem(message, column, self.file, line))
        else:
            self.more += 1

    def problems(self) -> list[Problem]:
        """All of them; those that are not shown are counted."""
        if not self.more:
            return self.shown
        return [*self.shown, Problem(f"{self.more:,} more entries are wrong", file=self.file)]


def read(
    path: str | os.PathLike[str],
    time: str = "time",
    measured: Sequence[str] | None = None,
    whole: bool = False,
) -> Recording:
    """The recording in a file with a header line, in UTF-8, fields separated by commas.

    time: the column of times. measured: the columns of the measurements; None means all others, in their order.
    whole: whether times are numbers of steps. An empty field, NaN and NA mean not measured.
    Raises `ConfigError`: alone, for a file that cannot be read and for its header; else with every row that is wrong.
    """
    name = os.fspath(path)
    faults, stopped = Faults(name), []
    try:
        with Path(path).open("rb") as file:
            reader = csv.reader(_lines(file, name), skipinitialspace=True, strict=True)
            header = [field.strip() for field in next(reader, [])]
            columns = _columns(header, time, measured, name)
            names = tuple(header[i] for i in columns.measured)
            recording = Recording(name, names, array("d"), array("d"), array("q"))
            _fill(recording, reader, header, columns, whole, faults)
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or str(error))
        stopped = [Problem(f"cannot read the data: {reason.lower()}", file=name)]
    except csv.Error as error:
        stopped = [
            Problem(f"not a table of comma-separated values: {error}", file=name, line=reader.line_num)
        ]
    except ConfigError as error:
        stopped = error.problems
    problems = [*faults.problems(), *stopped]
    if not problems and not recording.times:
        problems = [Problem("no row of data below the header", file=name)]
    if problems:
        raise ConfigError(problems)
    return recording


def _lines(file: Any, name: str) -> Iterator[str]:
    """The lines of a file. Raises `ConfigError` where they are not text."""
    for number in count(1):
        raw = file.readline(LONGEST_LINE + 1)
        if not raw:
            return
        message, column = "", None
        if len(raw) > LONGEST_LINE:
            message = f"longer than {LONGEST_LINE:,} bytes: not a table of measurements"
        elif b"\0" in raw:
            message = "a binary file, not a table of comma-separated values"
        try:
            text = raw.decode("utf-8-sig" if number == 1 else "utf-8")
        except UnicodeDecodeError as error:
            message, column = message or "not text in UTF-8", error.start + 1
        if message:
            raise ConfigError([Problem(message, file=name, line=number, column=column)])
        yield text


def _columns(header: list[str], time: str, measured: Sequence[str] | None, file: str) -> Columns:
    """What the header says. Raises `ConfigError` with everything that is wrong with it."""
    if not any(header):
        raise ConfigError([Problem(f"no header in the first line; expected one such as {time},y", file=file)])
    others = [name for name in header if name != time]
    chosen = others if measured is None else list(measured)
    wrong = [f"the column '{name}' stands {times} times" for name, times in _repeated(header)]
    if time not in header:
        separator = next((mark for mark in (";", "\t") if mark in header[0]), None)
        hint = f"; fields are separated by commas, not by {separator!r}" if separator else ""
        wrong.append(f"no column '{time}'{hint or suggestion(time, header)} (--time names it)")
    elif not others:
        wrong.append(f"no column beside '{time}': nothing was measured")
    if measured is not None:
        unknown = [name for name in chosen if name not in others]
        wrong += [f"no column '{name}' to measure{suggestion(name, others)}" for name in unknown]
        wrong += [f"the measurement '{name}' is named {times} times" for name, times in _repeated(chosen)]
    if wrong:
        raise ConfigError([Problem(message, file=file, line=1) for message in wrong])
    return Columns(len(header), header.index(time), tuple(header.index(name) for name in chosen))


def _repeated(names: Sequence[str]) -> list[tuple[str, int]]:
    """Names that stand more than once, and how often."""
    return [(name, times) for name, times in Counter(names).items() if times > 1]


def _fill(
    recording: Recording, reader: Any, header: list[str], columns: Columns, whole: bool, faults: Faults
) -> None:
    """Append the rows that are right; the others are faults."""
    _, _, times, values, lines = recording
    before = ""
    for row in reader:
        if not row:
            continue
        line = reader.line_num
        if len(lines) == MOST_ROWS:
            more = f"more than {MOST_ROWS:,} rows; nlbench.filter_data takes any number, from Python"
            raise ConfigError([Problem(more, file=recording.file)])
        if len(row) != columns.fields:
            faults.add(f"expected {columns.fields} fields, found {len(row)}", line)
            continue
        text = row[columns.time].strip()
        time = _number(text)
        wrong = _wrong_time(text, time, whole)
        if not wrong and times:
            wrong = _wrong_order(text, time, before, times[-1], lines[-1])
        if wrong:
            faults.add(wrong, line, header[columns.time])
        for i in columns.measured:
            field = row[i].strip()
            value = math.nan if field.lower() in MISSING else _number(field)
            if not math.isnan(value) or field.lower() in MISSING:
                values.append(value)
            else:
                faults.add(f"expected a finite number, found {_shown(field)}", line, header[i])
        if not math.isnan(time):
            times.append(time)
            lines.append(line)
            before = text


def _number(text: str) -> float:
    """The finite number that the text states in ASCII digits; NaN for any other text."""
    try:
        number = math.nan if "_" in text or not text.isascii() else float(text)
    except ValueError:
        return math.nan
    return number if math.isfinite(number) else math.nan


def _wrong_time(text: str, time: float, whole: bool) -> str:
    if math.isnan(time):
        return f"expected a time, found {_shown(text)}"
    if whole and not time.is_integer():
        return f"expected a step number, since the system's time is discrete, found {text}"
    return ""


def _wrong_order(text: str, time: float, before: str, last: float, line: int) -> str:
    """What is wrong with a time after the one, `before`, that is `last` as a number and stands in that line."""
    if time < last:
        return f"{text} comes after {before} of line {line}; times must not descend"
    if time == last and text != before and not _equal(text, before):
        return f"{text} and {before} of line {line} are one number in double precision; subtract a start from all"
    return ""


def _equal(text: str, before: str) -> bool:
    """Whether both state one number; not where an exponent is beyond what a decimal holds."""
    try:
        return Decimal(text) == Decimal(before)
    except ArithmeticError:
        return False


def _shown(text: str) -> str:
    return "nothing" if not text else repr(text if len(text) <= 40 else f"{text[:36]} ...")
