"""Text in Markdown, as code forges show it."""

from __future__ import annotations

import re

from nlbench.errors import printable

SPECIAL = re.compile(r"([\\`*_\[\]<>|~$#!&@])")
LIST = re.compile(
    r"^(\d+(?=[.)](?:\s|$))|(?=[-+=]))"
)  # what starts a list or underlines a heading at the start of a line


def plain(text: str) -> str:
    """Text that Markdown shows as it is, on one line."""
    return LIST.sub(r"\1\\", SPECIAL.sub(r"\\\1", printable(" ".join(text.split()))))
