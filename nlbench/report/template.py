"""Pages from templates: one file that needs no network, with the style and the script that all pages share."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


def render(template: str, **variables: object) -> str:
    """The page from a template, named from the package's folder. Everything is escaped but what is `Markup`."""
    return _environment().get_template(template).render(**variables) + "\n"


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("nlbench", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["text"] = _text
    return environment


def _text(name: str) -> Markup:
    """A style sheet or script of the package, as it is."""
    from markupsafe import Markup

    return Markup(files("nlbench").joinpath(name).read_text("utf-8").rstrip("\n"))
