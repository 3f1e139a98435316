"""Addresses of files as they stand on the page: relative to its folder."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote


class Link(NamedTuple):
    """What is read, and where it leads."""

    text: str
    address: str


def address(path: Path, folder: Path) -> str:
    """The way from the folder to a file, fit for a link."""
    return quote(Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix())


def links(paths: Iterable[Path], folder: Path) -> tuple[Link, ...]:
    """A link by the name of each file."""
    return tuple(Link(path.name, address(path, folder)) for path in paths)
