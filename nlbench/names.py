"""Names of files that are made of names which people chose. Loads nothing."""

from __future__ import annotations

import re


def of_file(name: str) -> str:
    """The name without characters that mean something in a path, a link or an identifier."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", name)
