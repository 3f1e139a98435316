"""Where each key and value of an experiment stands: in its file, or in an option of the command line."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from nlbench.errors import Problem

Path = tuple[str | int, ...]


class Place(NamedTuple):
    """Where something stands: in a file (line and column from 1) or in an option of the command line."""

    file: str
    line: int | None = None
    column: int | None = None
    source_line: str | None = None

    def problem(self, path: Path, message: str) -> Problem:
        """What is wrong with the key or value that stands here."""
        return Problem(message, dotted(path), self.file, self.line, self.column, self.source_line)


@dataclass
class Document:
    """Plain data (mappings, lists, scalars) and where each key and value stands."""

    data: Any
    root: Place
    question: str = ""
    keys: dict[Path, Place] = field(default_factory=dict)
    values: dict[Path, Place] = field(default_factory=dict)

    def problem(self, path: Path, message: str, at_key: bool = False) -> Problem:
        """A problem placed at the nearest known ancestor of `path`; `at_key` prefers the key to the value."""
        return self._nearest(path, at_key).problem(path, message)

    def _nearest(self, path: Path, at_key: bool) -> Place:
        for length in range(len(path), 0, -1):
            start = path[:length]
            exact = length == len(path)
            first, second = (self.keys, self.values) if at_key or not exact else (self.values, self.keys)
            found = first.get(start) or second.get(start)
            if found:
                return found
        return self.root


def dotted(path: Path) -> str:
    """A path as messages and `--set` write it: `filters.0.limiter`."""
    return ".".join(str(part) for part in path)


def keys(path: str) -> Path:
    """The path that `dotted` wrote; a key that holds a point is several."""
    return tuple(int(part) if part.isdigit() else part for part in path.split("."))
