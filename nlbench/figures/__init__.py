"""Figures of a run, drawn from its saved tables: SVG and PNG files in the run's folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from nlbench.errors import ConfigError
from nlbench.figures import style
from nlbench.figures.consistency import nees
from nlbench.figures.cost import cost
from nlbench.figures.data import Data, chosen, read
from nlbench.figures.density import density
from nlbench.figures.divergence import divergence
from nlbench.figures.error_curves import mean_error, rms, rms_clipped
from nlbench.figures.final import final
from nlbench.figures.moment_curves import third_moment, variance
from nlbench.figures.picture import Picture, png, settle, svg
from nlbench.figures.responses import response
from nlbench.figures.traces import trace
from nlbench.results.atomic import atomic_write, remove

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from nlbench.results.results import Results

FIGURES: dict[str, Callable[[Data], Iterator[Picture]]] = {
    "rms": rms,
    "rms_clipped": rms_clipped,
    "mean_error": mean_error,
    "variance": variance,
    "third_moment": third_moment,
    "nees": nees,
    "divergence": divergence,
    "trace": trace,
    "density": density,
    "response": response,
    "cost": cost,
    "final": final,
}
# Drawn only where an experiment file asks for them: there are many pictures of these, or they show what others do.
ON_REQUEST = ("density", "response", "final")


def one(
    results: Results, name: str, coordinate: str | None = None, filters: Sequence[str] | None = None
) -> Figure:
    """The figure of a kind, a key of `FIGURES`, of one coordinate (default: the first) and some filters (all).

    Raises `ConfigError` where there is none.
    """
    with style.context(salt=name):
        pictures = {each.name: settle(each) for each in FIGURES[name](chosen(read(results), filters))}
    wanted = next(iter(pictures), "") if coordinate is None else f"{name}-{coordinate}"
    if wanted not in pictures:
        there = ", ".join(each.removeprefix(f"{name}-") for each in pictures) or "nothing of that kind"
        raise ConfigError(f"no figure '{name}' of {coordinate or 'this run'}; there is: {there}")
    return pictures[wanted].figure


def draw(results: Results, names: Sequence[str] | None = None) -> list[Path]:
    """Draw the figures of a run into its folder `figures/`, as SVG and PNG. Returns the paths written.

    `names` are keys of `FIGURES`; by default those that the experiment asks for, or all but those `ON_REQUEST`, as far
    as its tables allow. Pictures that the run no longer has are removed: of the kinds named, by default of all kinds.
    Raises `ConfigError` for an unknown name.
    """
    kinds = FIGURES if names is None else names
    if names is None:
        names = results.experiment.figures
    if names is None:
        names = [name for name in FIGURES if name not in ON_REQUEST]
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        raise ConfigError(f"unknown figure {', '.join(map(repr, unknown))}; known: {', '.join(FIGURES)}")
    folder = results.path / "figures"
    data = read(results)
    written = []
    for name in names:
        with style.context(salt=name):
            for picture in map(settle, FIGURES[name](data)):
                for suffix, content in (("svg", svg(picture)), ("png", png(picture))):
                    path = folder / f"{picture.file_name}.{suffix}"
                    atomic_write(path, content)
                    written.append(path)
    for path in sorted(folder.glob("*")):
        if path.stem.split("-")[0] in kinds and path not in written:
            remove(path)
    return written
