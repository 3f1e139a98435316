"""Pictures of an entry: those in the folders of its experiments with small copies, or drawn without any run."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from html import unescape
from pathlib import Path
from typing import TYPE_CHECKING

from nlbench.reproduce.summary import PictureFile
from nlbench.results.atomic import atomic_write, remove

if TYPE_CHECKING:
    from nlbench.reproduce.documents import Item
    from nlbench.reproduce.summary import ExperimentRun

WITHOUT_RUNS = ("hermite_densities",)
HEAD = 20_000  # bytes of an SVG in which its title and description stand


def of(item: Item, slug: str, runs: Iterable[ExperimentRun], folder: Path) -> tuple[PictureFile, ...]:
    """The pictures that the entry names, as far as its experiments have them; small ones are written to `folder`."""
    return tuple(_pictures(item, slug, list(runs), folder))


def sweep(folder: Path, kept: Iterable[PictureFile]) -> None:
    """Remove small pictures that an earlier summary left in the folder."""
    files = {path for each in kept for path in (each.small, each.png)}
    for path in sorted([*folder.glob("*.svg"), *folder.glob("*.png")]):
        if path not in files:
            remove(path)


def _pictures(item: Item, slug: str, runs: list[ExperimentRun], folder: Path) -> Iterator[PictureFile]:
    from nlbench.figures.small import small

    if not item.experiments:
        yield from (_drawn(name, folder / f"{slug}-{name}") for name in item.pictures)
    for run in runs:
        if run.folder is None:
            continue
        middle = f"-{run.name.split('/')[-1]}" if len(runs) > 1 else ""
        for name in item.pictures:
            svg = run.folder / "figures" / f"{name}.svg"
            if not svg.exists():
                continue
            path = folder / f"{slug}{middle}-{name}.svg"
            content = svg.read_bytes()
            atomic_write(path, small(content))
            head = content[:HEAD].decode(errors="ignore")
            words = {tag: _element(head, tag) for tag in ("title", "desc")}
            png = svg.with_suffix(".png")
            yield PictureFile(run.name, name, words["title"], words["desc"], svg, png, path)


def _drawn(name: str, path: Path) -> PictureFile:
    """A picture that needs no run, one of `WITHOUT_RUNS`."""
    from nlbench.figures import hermite_densities, picture, style
    from nlbench.figures.small import small

    made = {"hermite_densities": hermite_densities.hermite_densities}[name]
    with style.context(salt=name):
        drawn = picture.settle(made())
        svg, png = path.with_name(f"{path.name}.svg"), path.with_name(f"{path.name}.png")
        atomic_write(svg, small(picture.svg(drawn)))
        atomic_write(png, picture.png(drawn))
    return PictureFile("", name, drawn.title, drawn.description, svg, png, svg)


def _element(text: str, tag: str) -> str:
    """The text of the first element of that name."""
    found = re.search(rf"<{tag}\b[^>]*>(.*?)</{tag}>", text, re.DOTALL)
    return unescape(found[1]).strip() if found else ""
