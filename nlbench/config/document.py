"""A YAML file as plain data with places; errors of reading and of syntax in plain words."""

from __future__ import annotations

import os
import re
from pathlib import Path as FilePath
from typing import Any

from nlbench.config.nodes import Reader
from nlbench.config.places import Document, Place
from nlbench.errors import ConfigError, Problem

LINE_END = re.compile("\r\n|[\r\x85\u2028\u2029]")  # beside \n, where the parser begins another line
LARGEST_FILE = 200_000
EDITOR_HINT = re.compile(r"#\s*(!|yaml-language-server|vim?:|-\*-)")


def read(path: str | os.PathLike[str]) -> Document:
    """The document in a file. Raises `ConfigError` when it cannot be read or is not one YAML mapping."""
    name = os.fspath(path)
    return compose(_text(name), name)


def compose(text: str, name: str) -> Document:
    """The document in `text`; `name` is what messages call it. Raises `ConfigError` at errors of syntax."""
    text = LINE_END.sub("\n", text)
    node = _parsed(text, name)
    lines = text.split("\n")
    first = next((at for at, line in enumerate(lines) if line.strip()[:1] not in ("", "#")), 0)
    root = Place(name, first + 1, 1, lines[first])
    if node is None:
        raise ConfigError(
            [Problem("the file is empty; an experiment needs experiment, system and filters", file=name)]
        )
    if not node.tag.endswith(":map"):
        raise ConfigError(
            [root.problem((), "expected keys with values at the top level, such as 'experiment: name'")]
        )
    document = Document({}, root, question(lines))
    reader = Reader(document, name, lines)
    document.data = reader.plain(node, ())
    if reader.problems:
        raise ConfigError(reader.problems)
    return document


def value_of(text: str, name: str) -> Any:
    """The plain data of a YAML value given in an option of the command line."""
    node = _parsed(text, name, short=True)
    if node is None:
        return None
    reader = Reader(Document({}, Place(name)), name, None)
    data = reader.plain(node, ())
    if reader.problems:
        raise ConfigError(reader.problems)
    return data


def question(lines: list[str]) -> str:
    """The first comment line, if it comes before the first key."""
    for line in lines:
        line = line.strip().removeprefix("\ufeff")
        if line.startswith("#") and not EDITOR_HINT.match(line):
            return line.lstrip("# ")
        if line and not line.startswith("#"):
            break
    return ""


def _text(name: str) -> str:
    try:
        with FilePath(name).open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except OSError as error:
        reason = (
            "no such file" if isinstance(error, FileNotFoundError) else (error.strerror or str(error)).lower()
        )
        raise ConfigError([Problem(f"cannot read the experiment: {reason}", file=name)]) from None
    except ValueError:
        raise ConfigError([Problem("cannot read the experiment: not a file name", file=repr(name))]) from None
    if b"\0" in content:
        raise ConfigError([Problem("a binary file, not an experiment in YAML", file=name)])
    if len(content) > LARGEST_FILE:
        raise ConfigError([Problem(f"larger than {LARGEST_FILE:,} bytes: not an experiment file", file=name)])
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        column = error.start - content.rfind(b"\n", 0, error.start)
        raise ConfigError([Problem("not text in UTF-8", file=name, line=line, column=column)]) from None


def _parsed(text: str, name: str, short: bool = False) -> Any:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError
    from ruamel.yaml.reader import ReaderError

    try:
        return YAML(typ="rt", pure=True).compose(text)
    except ReaderError as error:
        before = text[: error.position]
        place = Place(name, before.count("\n") + 1, error.position - before.rfind("\n"))
        code = error.character if isinstance(error.character, int) else ord(error.character)
        message = f"the character U+{code:04X} is not allowed in YAML"
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        lines = LINE_END.sub("\n", text).split("\n")
        line = min(mark.line, len(lines) - 1) if mark else 0
        place = Place(name, line + 1, mark.column + 1 if mark else 1, lines[line])
        message = _syntax(error, lines[line])
    except (YAMLError, ValueError, NotImplementedError, AssertionError, IndexError, AttributeError) as error:
        place, message = (
            Place(name),
            f"not valid YAML: {str(error).splitlines()[0] if str(error) else 'unreadable'}",
        )
    except RecursionError:
        place, message = Place(name), "nested too deeply"
    raise ConfigError([Place(name).problem((), message) if short else place.problem((), message)])


def _syntax(error: Any, line: str) -> str:
    """The scanner's complaint in the words of someone who writes an experiment."""
    problem = " ".join(str(error.problem or error.context or "cannot be read").split())
    if "\\t" in problem:
        return "a tab cannot indent YAML; use spaces"
    if "another document" in problem:
        return "a second document begins here ('---'); a file holds one experiment"
    if "mapping values are not allowed" in problem:
        return "a ':' is not allowed here; quote text that holds ': '"
    opened = (
        f" (opened in line {error.context_mark.line + 1})"
        if error.context_mark and "flow" in error.context
        else ""
    )
    return f"not valid YAML: {problem}{opened}"
