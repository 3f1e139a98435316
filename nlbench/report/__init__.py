"""The report of a run: one HTML page that needs no network, made from saved tables."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlbench.results.results import Results


def write(results: Results) -> Path:
    """Draw the figures of a run and write its `report.html`. Returns the path of the page."""
    from nlbench import figures
    from nlbench.report.contents import contents
    from nlbench.results.atomic import atomic_write

    drawn = figures.draw(results)
    path = results.path / "report.html"
    atomic_write(path, render(contents(results, drawn)).encode())
    return path


def render(contents: dict[str, object]) -> str:
    """The page. Everything is escaped but the figures and the page's own style and script."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    parts = {
        name: files("nlbench.report").joinpath(f"page.{name}").read_text("utf-8")
        for name in ("html", "css", "js")
    }
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    style = {name: Markup(parts[name]) for name in ("css", "js")}
    return environment.from_string(parts["html"]).render(**contents, **style) + "\n"
