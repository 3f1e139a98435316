"""The sources: what each of their figures and tables shows, and which experiments of this package answer for it.

One file for each source, read into records. Whether they agree with the experiment files is tested, since both are
part of this package.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

NAMES = ("culver-1969", "schwartz-1967", "henriksen-1980", "athans-2001")
KINDS = ("figure", "table", "point")
Text = Annotated[str, Field(min_length=1), BeforeValidator(lambda text: str(text).strip())]


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Item(_Record):
    """A figure or table of a source, or a point that it makes in words.

    `experiments` are names; `pictures` file names, without suffix, in the folder `figures/` of their results.
    Instead of experiments there is a `reason` why none can answer, or a `check`, the name of a calculation; pictures
    are then those that need no run.
    """

    figure: str | None = None
    table: str | None = None
    point: str | None = None
    caption: Text
    experiments: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    reason: str = ""
    check: Literal["", "updating-equations", "moment-storage"] = ""

    @property
    def kind(self) -> str:
        """figure, table or point."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def number(self) -> str:
        """The source's number; of a point its short name."""
        return getattr(self, self.kind)

    @model_validator(mode="after")
    def _complete(self) -> Item:
        if sum(getattr(self, kind) is not None for kind in KINDS) != 1:
            raise ValueError("an entry is one of figure, table and point")
        if sum(map(bool, (self.experiments, self.reason, self.check))) != 1:
            raise ValueError("an entry has experiments, or a reason why not, or a check")
        return self


class Source(_Record):
    """A source with its entries, in its own order."""

    name: str
    title: Text
    citation: Text
    entries: tuple[Item, ...]


class Comparison(_Record):
    """Where the effect of an erratum shows: a statistic of two filters of an experiment.

    `printed` and `corrected` are their labels; the coordinate is the first and the time the last unless given.
    `against` is the experiment of the corrected one where it is another.
    """

    experiment: str
    printed: str
    corrected: str
    against: str | None = None
    statistic: str = "rms_clipped"
    coordinate: str | None = None
    time: float | None = None


class Error(_Record):
    """A numbered error of a source, in words, and where its effect shows, or `why_not`."""

    document: Literal["culver-1969", "schwartz-1967", "henriksen-1980", "athans-2001"]
    number: Text
    equation: Text
    printed: Text
    right: Text
    consequence: Text
    why_not: str = ""
    effects: tuple[Comparison, ...] = ()

    @property
    def experiments(self) -> tuple[str, ...]:
        """Names of the experiments in which its effects show, each once."""
        names = [name for each in self.effects for name in (each.experiment, each.against) if name]
        return tuple(dict.fromkeys(names))

    @model_validator(mode="after")
    def _complete(self) -> Error:
        if bool(self.why_not) == bool(self.effects):
            raise ValueError("an erratum has effects, or a reason why none can be shown")
        return self


@cache
def source(name: str) -> Source:
    """The source of that name, one of `NAMES`."""
    return Source(name=name, **_read(name))


@cache
def errors() -> tuple[Error, ...]:
    """The numbered errors of all sources."""
    return tuple(Error(**each) for each in _read("errata")["errata"])


def _read(name: str) -> dict[str, Any]:
    from ruamel.yaml import YAML

    text = files(__name__).joinpath(f"{name}.yaml").read_text("utf-8")
    return YAML(typ="safe", pure=True).load(text)
