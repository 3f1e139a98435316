"""Docstrings and tables as Markdown."""

from __future__ import annotations

import ast
import importlib.util
import re
import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path

# What Python-Markdown lets a backslash escape, and what it does not.
SPECIAL = re.compile(r"([*_|\[\]\\#])")
ENTITIES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "$": "&#36;"})
EXIT = re.compile(r"(`[^`]*`)")


def docstring(module: str) -> str:
    """The docstring of a module, which is not imported."""
    found = importlib.util.find_spec(module)
    assert found is not None
    assert found.origin is not None
    return ast.get_docstring(ast.parse(Path(found.origin).read_text(encoding="utf-8"))) or ""


def markdown(text: str) -> str:
    """A docstring: what is indented is set as it stands, all else is prose."""
    blocks: list[str] = []
    prose: list[str] = []
    verbatim: list[str] = []

    def close() -> None:
        if prose:
            blocks.append("\n".join(prose))
        if verbatim:
            blocks.append("```text\n" + textwrap.dedent("\n".join(verbatim)).rstrip() + "\n```")
        prose.clear()
        verbatim.clear()

    for line in text.splitlines():
        indented = line.startswith("  ")
        if not line.strip() or (indented and prose) or (not indented and verbatim):
            close()
        if line.strip():
            (verbatim if indented else prose).append(line.rstrip() if indented else escaped(line))
    close()
    return "\n\n".join(blocks)


def escaped(text: str) -> str:
    """Prose in which no character means anything to Markdown, code spans apart."""
    parts = EXIT.split(text)
    return "".join(
        part if part.startswith("`") and len(part) > 1 else SPECIAL.sub(r"\\\1", part).translate(ENTITIES)
        for part in parts
    )


def cell(text: str) -> str:
    """Text in a cell of a table: no line ends in it, and no column."""
    parts = EXIT.split(" ".join(text.split()))
    return "".join(part.replace("|", "\\|") if part.startswith("`") else escaped(part) for part in parts)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; cells are Markdown already."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def sentences(text: str, word: str) -> list[str]:
    """The sentences of a docstring that begin with a word, such as Cost or Fails."""
    flat = " ".join(text.split())
    return re.findall(rf"(?:(?<=[.)] )|^)({word}\b.*?\.)(?= [A-Z(`]|$)", flat)
