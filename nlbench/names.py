"""Names of files that are made of names which people chose. Loads nothing."""

from __future__ import annotations

import re


def of_file(name: str) -> str:
    """The name without what means something in a path, a link or an identifier; letters of any script stay."""
    return re.sub(r"[^\w.-]", "_", name)
