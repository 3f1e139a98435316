"""Composed YAML nodes as plain data; what has no place in an experiment (tags, duplicate keys) is refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from nlbench.config.places import Document, Path, Place
from nlbench.errors import ConfigError, Problem

MOST_VALUES = 20_000
DEEPEST = 24
TAG = "tag:yaml.org,2002:"
MOST_DIGITS = 1000  # of an integer; Python writes none of more than 4,300
INTEGRAL = 2**53  # from here on a float does not tell one integer from the next


class Reader:
    """Turns composed nodes into plain data; collects duplicate keys, tags and unreadable values."""

    def __init__(self, document: Document, name: str, lines: list[str] | None) -> None:
        self.document, self.name, self.lines = document, name, lines
        self.problems: list[Problem] = []
        self.count = 0

    def plain(self, node: Any, path: Path) -> Any:
        self.count += 1
        if self.count > MOST_VALUES:
            raise ConfigError(
                [Problem(f"holds more than {MOST_VALUES:,} values (aliases included)", file=self.name)]
            )
        if len(path) > DEEPEST:
            raise ConfigError([self._place(node).problem(path[:4], "nested too deeply")])
        if path:
            self.document.values[path] = self._place(node)
        kind = node.tag.removeprefix(TAG)
        if (node.id, kind) == ("mapping", "map"):
            return dict(self._items(node, path))
        if (node.id, kind) == ("sequence", "seq"):
            return [self.plain(item, (*path, index)) for index, item in enumerate(node.value)]
        return self._scalar(node, path)

    def _scalar(self, node: Any, path: Path) -> Any:
        """A word or number of a tag that plain values have; anything else is refused."""
        kind = node.tag.removeprefix(TAG)
        if node.id != "scalar" or kind not in _SCALARS:
            self._refuse(node, path, f"the tag '{_tag(node.tag)}' is not allowed; write plain values")
            return None
        try:
            return _SCALARS[kind](node.value)
        except (ValueError, OverflowError):
            shown = node.value if len(node.value) < 40 else node.value[:36] + " ..."
            self._refuse(
                node, path, f"cannot read {shown!r} as {'a number' if kind in ('int', 'float') else kind}"
            )
            return None

    def _items(self, node: Any, path: Path) -> Iterator[tuple[str, Any]]:
        seen: dict[str, Place] = {}
        for key, value in node.value:
            if key.id != "scalar":
                self._refuse(key, path, "a key must be a word")
                continue
            here = (*path, key.value)
            self._scalar(key, here)
            if key.value in seen:
                again = f" (first in line {seen[key.value].line})" if seen[key.value].line else ""
                self._refuse(key, here, f"the key '{key.value}' stands twice{again}")
                continue
            seen[key.value] = self.document.keys[here] = self._place(key)
            yield key.value, self.plain(value, here)

    def _refuse(self, node: Any, path: Path, message: str) -> None:
        self.problems.append(self._place(node).problem(path, message))

    def _place(self, node: Any) -> Place:
        if self.lines is None:
            return Place(self.name)
        line, column = node.start_mark.line, node.start_mark.column
        shown = self.lines[line] if line < len(self.lines) else None
        return Place(self.name, line + 1, column + 1, shown)


def _tag(tag: str) -> str:
    return "!!" + tag.removeprefix(TAG) if tag.startswith(TAG) else tag


def _whole(text: str) -> int:
    text = text.replace("_", "").lower()
    digits = text.lstrip("+-")
    if len(digits) > MOST_DIGITS:
        raise ValueError(text)
    return int(text, 0) if digits[:2] in ("0x", "0o", "0b") else int(text)


def _number(text: str) -> int | float:
    """A float; without a fraction, an integer: 1e6 may count runs, and where a float is wanted it is one."""
    text = text.replace("_", "").lower()
    special = {".nan": "nan", ".inf": "inf", "+.inf": "inf", "-.inf": "-inf"}
    number = float(special.get(text, text))
    return int(number) if abs(number) < INTEGRAL and number.is_integer() else number


def _truth(text: str) -> bool:
    if text.lower() not in ("true", "false"):
        raise ValueError(text)
    return text.lower() == "true"


_SCALARS: dict[str, Any] = {
    "str": str,
    "timestamp": str,
    "merge": str,
    "value": str,
    "null": lambda text: None,
    "bool": _truth,
    "int": _whole,
    "float": _number,
}
