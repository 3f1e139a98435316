"""The figures of a run as parts of the page."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import unescape
from pathlib import Path
from typing import NamedTuple

from markupsafe import Markup

DECLARATIONS = re.compile(
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|\sxmlns(:\w+)?=\"[^\"]*\"", re.DOTALL
)


class Embedded(NamedTuple):
    """A figure's SVG for the page, its title, what it shows in words, and its files."""

    svg: Markup
    title: str
    description: str
    files: tuple[Path, ...]


def embedded(paths: Iterable[Path]) -> list[Embedded]:
    """The figures whose SVG files are among `paths`, in their order."""
    paths = list(paths)
    found = []
    for path in paths:
        if path.suffix == ".svg":
            text = path.read_text(encoding="utf-8")
            files = tuple(other for other in paths if other.stem == path.stem)
            found.append(Embedded(inline(text), _words(text, "title"), _words(text, "desc"), files))
    return found


def inline(svg: str) -> Markup:
    """SVG as it stands inside HTML: without declarations, which name addresses that nobody needs to visit.

    It is safe to leave unescaped: `nlbench.figures` escaped all that users may have written into it.
    """
    return Markup(DECLARATIONS.sub("", svg).replace("xlink:href", "href").strip())


def _words(svg: str, element: str) -> str:
    """Text of the first such element."""
    found = re.search(rf"<{element}[^>]*>(.*?)</{element}>", svg, re.DOTALL)
    return unescape(found[1]) if found else ""
