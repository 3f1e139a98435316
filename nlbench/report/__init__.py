"""The report of a run: one HTML page that needs no network, made from saved tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlbench.results.results import Results


def brief(results: Results) -> str:
    """The essence of a run as a fragment of HTML, for a cell of a notebook."""
    from nlbench.report import fragment

    return fragment.brief(results)


def write(results: Results) -> Path:
    """Draw the figures of a run and write its `report.html`. Returns the path of the page.

    Raises `LockedError` where a live run, or another report, is writing in the folder.
    """
    from nlbench import figures
    from nlbench.report.contents import contents
    from nlbench.report.template import render
    from nlbench.results.atomic import atomic_write
    from nlbench.results.folder import RunFolder

    path = results.path / "report.html"
    with RunFolder(results.path).locked():
        drawn = figures.draw(results)
        atomic_write(path, render("report/page.html", **contents(results, drawn)).encode())
    return path
