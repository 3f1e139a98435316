"""A finished figure with its title and description, as SVG and PNG bytes that depend on nothing but the data."""

from __future__ import annotations

import re
from html import escape
from io import BytesIO, StringIO
from typing import TYPE_CHECKING, NamedTuple

from nlbench.names import of_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
ROOT_STYLE = (
    "stroke-linejoin:round;stroke-linecap:butt"  # what matplotlib puts into a style element for every `*`
)


class Picture(NamedTuple):
    """A figure with `name`, the kind, `-` and the coordinate. `description` is for those who cannot see it."""

    name: str
    title: str
    description: str
    figure: Figure

    @property
    def file_name(self) -> str:
        """The name as a path, a link or an identifier may hold it."""
        return of_file(self.name)


def settle(picture: Picture) -> Picture:
    """The picture with its layout computed once, for all formats."""
    engine = picture.figure.get_layout_engine()
    if engine is not None:
        engine.execute(picture.figure)
    picture.figure.set_layout_engine("none")
    return picture


def png(picture: Picture) -> bytes:
    """The picture as PNG, without the version of the software that drew it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = BytesIO()
    # Not by `savefig`, which would draw the figure once more for its layout.
    FigureCanvasAgg(picture.figure).print_png(buffer, metadata={"Software": None})
    return buffer.getvalue()


def svg(picture: Picture) -> bytes:
    """The picture as SVG with title, description and role, fit to stand alone or beside others in one page.

    Identifiers carry the picture's name, and no style element speaks about the rest of the page.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer, dpi = StringIO(), picture.figure.dpi
    FigureCanvasSVG(picture.figure).print_svg(buffer, metadata=NO_METADATA)
    picture.figure.dpi = dpi  # which it sets to that of SVG
    text = buffer.getvalue()
    text = re.sub(
        r"<defs>\s*<style type=\"text/css\">.*?</style>\s*</defs>\s*", "", text, count=1, flags=re.DOTALL
    )
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{picture.file_name}-", text)
    names = f"{picture.file_name}-title {picture.file_name}-desc"
    text = text.replace("<svg ", f'<svg role="img" aria-labelledby="{names}" style="{ROOT_STYLE}" ', 1)
    head = f'<title id="{picture.file_name}-title">{escape(picture.title)}</title>\n'
    head += f'<desc id="{picture.file_name}-desc">{escape(picture.description)}</desc>\n'
    start = text.index(">", text.index("<svg ")) + 1
    return (text[:start] + "\n" + head + text[start:].lstrip("\n")).encode()
