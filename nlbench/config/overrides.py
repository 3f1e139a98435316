"""Values that the command line puts into an experiment: `--set monte_carlo.runs=1e5`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from nlbench.config.document import value_of
from nlbench.config.nodes import DEEPEST
from nlbench.config.places import Document, Path, Place, dotted
from nlbench.errors import ConfigError, Problem

LONGEST_KEY = 60  # of which a message shows all


class Override(NamedTuple):
    """A key, the text of its value, and the option that brought it, as the user typed it."""

    key: str
    text: str
    option: str


def parse(text: str) -> Override:
    """`key=value` of a `--set`. Raises `ConfigError` when there is no key or no `=`."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ConfigError(
            [Problem("expected key=value, such as monte_carlo.runs=1e5", file=f"--set {text[:60]}")]
        )
    key = key.strip()
    return Override(key, value, f"--set {key if len(key) <= LONGEST_KEY else key[:LONGEST_KEY] + ' ...'}")


def apply(document: Document, overrides: Sequence[str | Override]) -> list[Problem]:
    """Put each value into the document's data; what cannot be put there is returned, each with its option."""
    problems: list[Problem] = []
    for each in overrides:
        try:
            override = parse(each) if isinstance(each, str) else each
        except ConfigError as error:
            problems += error.problems
            continue
        path = tuple(_part(part) for part in re.split(r"[.\[]", override.key))
        place = Place(override.option)
        if len(path) > DEEPEST:
            problems.append(place.problem(path[:4], "nested too deeply"))
            continue
        try:
            value = value_of(override.text, override.option)
            path = _put(document, path, value)
        except ConfigError as error:
            problems += [each._replace(path=each.path or dotted(path)) for each in error.problems]
        except LookupError as error:
            problems.append(place.problem(path, str(error.args[0])))
        else:
            _mark(document, path, place)
    return problems


def _part(text: str) -> str | int:
    text = text.strip().removesuffix("]")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else text


def _put(document: Document, path: Path, value: Any) -> Path:
    """Write the value at the path, making the sections on the way; the path as the data spells it."""
    holder, spelled = document.data, list(path)
    for depth, part in enumerate(path):
        last = depth == len(path) - 1
        if isinstance(holder, list):
            if not isinstance(part, int) or part >= len(holder):
                raise LookupError(
                    f"'{dotted(path[:depth])}' is a list of {len(holder)}: expected an index below that"
                )
            if not last and isinstance(holder[part], str):
                holder[part] = {"name": holder[part]}
        elif isinstance(holder, dict):
            part = spelled[depth] = str(part)
            if not last and holder.get(part) is None:
                holder[part] = {}
            elif not last and part == "system" and isinstance(holder[part], str):
                holder[part] = {"name": holder[part]}
        else:
            raise LookupError(f"'{dotted(path[:depth])}' has no keys below it")
        if last:
            holder[part] = value
        else:
            holder = holder[part]
    return tuple(spelled)


def _mark(document: Document, path: Path, place: Place) -> None:
    """Let problems at or below the path point to the option instead of the file."""
    for places in (document.keys, document.values):
        for known in [each for each in places if each[: len(path)] == path]:
            del places[known]
    document.keys[path] = document.values[path] = place
