"""What a plug-in is: its names, what makes each system or filter, and what identifies its code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict

from nlbench.blame import locate_step
from nlbench.errors import ConfigError, NlbenchError

Kind = Literal["systems", "filters"]


class Entry(NamedTuple):
    """A system or filter of a plug-in.

    summary: one line. parameters: the model of its parameters or options. factory: (*leading, parameters) -> what it
    makes; leading is the system, for a filter. kind: (discrete, continuous) where nothing may be run to find out.
    """

    summary: str
    parameters: type[BaseModel]
    factory: Callable[..., Any]
    kind: tuple[bool, bool] | None = None


class Plugin(NamedTuple):
    """file: what it is called in results: the file's name, or the package's. digest: of its source, which identifies
    it. path: where the user named it. source: its text, with which another process can have it; empty if installed."""

    file: str
    digest: str
    path: str
    source: str
    systems: dict[str, Entry]
    filters: dict[str, Entry]

    def entries(self, kind: Kind) -> dict[str, Entry]:
        """Its systems or its filters."""
        return self.systems if kind == "systems" else self.filters


class Anything(BaseModel):
    """Parameters as results recorded them: whatever they are, they were checked when the run was made."""

    model_config = ConfigDict(extra="allow", frozen=True)


def made(plugin: Plugin, what: str, entry: Entry, *arguments: Any) -> Any:
    """What the factory of an entry makes. Raises `ConfigError` with the line of the plug-in where it raises.

    what: "system 'van-der-pol'", as messages name it.
    """
    try:
        return entry.factory(*arguments)
    except NlbenchError:
        raise
    except Exception as error:
        raise ConfigError([locate_step(error, plugin.path, f"{what}: making it failed")]) from None


def stand_in(spec: Any) -> Plugin:
    """In place of a plug-in that made saved results: its names and kinds."""

    def refuse(*arguments: Any) -> Any:
        raise ConfigError(f"this needs the plug-in {spec.file}: allow it with --plugin {spec.file}")

    says = f"of the plug-in {spec.file}"
    systems = {
        name: Entry(says, Anything, refuse, (kind.discrete, kind.continuous))
        for name, kind in spec.systems.items()
    }
    filters = {name: Entry(says, Anything, refuse) for name in spec.filters}
    return Plugin(spec.file, spec.digest, spec.file, "", systems, filters)
