"""Errors that a user can cause or must know about, each with its exit code. Loads nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

WIDTH = 76
LONGEST = 900  # characters of a message; lists of all names are shorter


class Problem(NamedTuple):
    """One thing wrong with an experiment: where it stands, which key it concerns, what is allowed.

    `file` is the file as the user named it, or the option (`--set time.step`) that brought the value; `line`
    and `column` count from 1 and are None for an option; `column` is where a line is wrong as a whole.
    """

    message: str
    path: str = ""
    file: str = ""
    line: int | None = None
    column: int | None = None
    source_line: str | None = None

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        path = "" if self.line is None and self.file.endswith(f" {self.path}") else self.path
        said = _shortened(printable(": ".join(part for part in (path, self.message) if part)))
        head = ": ".join(part for part in (printable(place), said) if part)
        if not self.source_line or self.column is None:
            return head
        return f"{head}\n{_pointed(self.source_line, self.column)}"


def _shortened(message: str) -> str:
    """A message without its middle, where it repeats a name or a value of thousands of characters."""
    return message if len(message) <= LONGEST else f"{message[: LONGEST // 2]} ... {message[-LONGEST // 2 :]}"


def printable(text: str) -> str:
    """The text with characters that do not print, or that command a terminal, as their codes; line ends stay."""
    return "".join(
        letter if letter.isprintable() or letter == "\n" else letter.encode("unicode_escape").decode()
        for letter in text
    )


def said(error: BaseException) -> str:
    """The first line of what an error says, after a colon; nothing where it says nothing, as a bare `assert`."""
    return "".join(f": {line}" for line in str(error).strip().splitlines()[:1])


def _pointed(line: str, column: int) -> str:
    """The line with a caret under its column (from 1), cut to the width of a terminal around that column."""
    start = max(0, column - 1 - WIDTH // 2) if len(line) > WIDTH else 0
    shown = "".join(letter if letter.isprintable() else " " for letter in line[start : start + WIDTH])
    return f"    {shown.rstrip()}\n    {' ' * (column - 1 - start)}^"


class NlbenchError(Exception):
    """Base of what the command line reports in plain words, without a traceback."""

    exit_code = 1
    told = False  # whether a JSON document that is printed has said it


class ConfigError(NlbenchError):
    """The experiment, a name or a parameter is wrong. `problems` holds all that was found."""

    exit_code = 2

    def __init__(self, problems: str | Sequence[Problem]) -> None:
        self.problems = [Problem(problems)] if isinstance(problems, str) else list(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[ConfigError], tuple[list[Problem]]]:
        return type(self), (self.problems,)


class Problems:
    """What is found while several things are made: `with problems.of(path): make()` for each, then `refuse()`."""

    def __init__(self) -> None:
        self.found: list[Problem] = []

    @contextmanager
    def of(self, path: str) -> Iterator[None]:
        """Keep what is wrong within; what has no place of its own stands at this path of the experiment."""
        try:
            yield
        except ConfigError as error:
            self.found += [
                each if each.path or each.file else each._replace(path=path) for each in error.problems
            ]

    def refuse(self) -> None:
        """Raises `ConfigError` with everything found, each once."""
        if self.found:
            raise ConfigError(list(dict.fromkeys(self.found)))


class GateError(NlbenchError):
    """A claim was not confirmed and the user asked for that to fail, or a verdict is not the one on record."""

    exit_code = 3


class LimitError(NlbenchError):
    """The run finished, but a filter failed altogether or diverged beyond the limit that the file sets."""

    exit_code = 4


class EnvironmentFault(NlbenchError):
    """The machine stands in the way: disk, permission, memory or device."""

    exit_code = 5


class DamagedResults(EnvironmentFault):
    """A result file is damaged, edited or of another version of the schema."""


class LockedError(NlbenchError):
    """Another live run holds the folder."""

    exit_code = 6


class NothingCompared(NlbenchError):
    """Two results have nothing in common."""

    exit_code = 7


class Interrupted(NlbenchError):
    """The user stopped the run; what was done is kept and the same command goes on from there."""

    exit_code = 130
