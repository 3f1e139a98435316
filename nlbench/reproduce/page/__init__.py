"""The page of a reproduction, `report.html`, which needs no network, and its Markdown twin, `README.md`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlbench.reproduce.summary import Summary


def write(summary: Summary, folder: Path) -> Path:
    """Write both into the folder. Returns the path of the page."""
    from nlbench.report.template import render
    from nlbench.reproduce.page.contents import contents
    from nlbench.reproduce.page.markdown import markdown
    from nlbench.results.atomic import atomic_write

    found = contents(summary, folder)
    page = folder / "report.html"
    atomic_write(page, render("reproduce/page/page.html", **found._asdict()).encode())
    atomic_write(folder / "README.md", markdown(found).encode())
    return page
