"""Systems and filters of the user's own: code that runs only when the user names its file or has installed it.

A plug-in is a Python file with `SYSTEMS = {"name": factory}`, `FILTERS = {"name": factory}` or both, or an installed
package with entry points of the groups `nlbench.systems` and `nlbench.filters`. Its names then stand beside the
built-in ones. An experiment file alone never makes code run. Importing this loads no numerical library.
"""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nlbench.errors import ConfigError, Problem
from nlbench.plugins import installed, source
from nlbench.plugins.plugin import Entry, Kind, Plugin, made, stand_in

__all__ = [
    "Entry",
    "Kind",
    "Plugin",
    "allow",
    "files",
    "find",
    "forget",
    "hint",
    "made",
    "names",
    "restore",
    "standing_in",
    "working",
]

_allowed: dict[str, Plugin] = {}  # by digest, in the order in which the user named them
_standing_in: list[Plugin] = []


def allow(*paths: str | Path, taken: Mapping[Kind, Collection[str]]) -> None:
    """Run these files and make their systems and filters known; a file that was allowed before is read anew.

    taken: names that are not free. Raises `ConfigError` with everything that is wrong with them.
    """
    problems: list[Problem] = []
    new: list[Plugin] = []
    for path in paths:
        try:
            plugin = source.of_file(path)
        except ConfigError as error:
            problems += error.problems
            continue
        kept = [each for each in _allowed.values() if each.path not in map(str, paths)]
        problems += _clashes(plugin, [*kept, *new], taken)
        new.append(plugin)
    if problems:
        raise ConfigError(problems)
    for plugin in new:
        _register(plugin)


def forget() -> None:
    """Withdraw what was allowed; what is installed stays."""
    _allowed.clear()


def files() -> tuple[str, ...]:
    """Paths of the files that were allowed, as the user gave them."""
    return tuple(plugin.path for plugin in _allowed.values())


def names(kind: Kind) -> tuple[str, ...]:
    """Names of the systems or filters that plug-ins bring; what is only installed is not imported for it."""
    own = [name for plugin in (*_standing_in, *_allowed.values()) for name in plugin.entries(kind)]
    return tuple(dict.fromkeys([*own, *installed.names(kind)]))


def working(kind: Kind, names: Iterable[str]) -> list[str]:
    """The names without those of installed plug-ins that are broken, each of which is said once."""
    return [name for name in names if installed.works(kind, name)]


def find(kind: Kind, name: str) -> tuple[Plugin, Entry] | None:
    """The plug-in that brings a name, and what it brings; None where none does.

    Raises `ConfigError` for an installed one that is broken.
    """
    for plugin in (*_standing_in, *_allowed.values()):
        if name in plugin.entries(kind):
            return plugin, plugin.entries(kind)[name]
    there = installed.find(kind, name)
    return None if there is None else (there, there.entries(kind)[name])


def hint(name: str) -> str:
    """What may be meant by an unknown name: that of a plug-in, which only the user can allow."""
    file, colon, _ = name.partition(":")
    if colon or "." in name:
        stem = file.removesuffix(".py").replace(".", "/")
        return f"; an experiment file cannot make code run: allow it with --plugin {stem}.py"
    return "; names of a plug-in are known with --plugin FILE.py"


def restore(wanted: Sequence[Any]) -> None:
    """Have the plug-ins of an experiment at hand, in this or another process, exactly as they were allowed.

    wanted: `PluginSpec`s, with the source that the user allowed; one that was only read from a file of results has
    none and runs nothing. Raises `ConfigError` for one that is neither at hand nor carried along.
    """
    for spec in wanted:
        if spec.digest in _allowed or installed.has(spec.digest):
            continue
        if not spec.source and any(Path(each.path).name == spec.file for each in _allowed.values()):
            raise ConfigError(f"this was made with other code of {spec.file} than is at hand")
        if not spec.source:
            raise ConfigError(
                f"this experiment needs the plug-in {spec.file}: allow it with --plugin {spec.file}"
            )
        _register(source.executed(spec.source, spec.path))


@contextlib.contextmanager
def standing_in(recorded: Sequence[Any]) -> Iterator[None]:
    """Within it, what the plug-ins of saved results brought is known by name and kind, and no code runs."""
    before = len(_standing_in)
    _standing_in.extend(stand_in(spec) for spec in recorded)
    try:
        yield
    finally:
        del _standing_in[before:]


def _register(plugin: Plugin) -> None:
    for digest, other in list(_allowed.items()):
        if other.path == plugin.path:
            del _allowed[digest]
    _allowed[plugin.digest] = plugin


def _clashes(
    plugin: Plugin, others: Sequence[Plugin], taken: Mapping[Kind, Collection[str]]
) -> Iterator[Problem]:
    """What is wrong with the names of a plug-in: those that are not free, whatever their capitals.

    The same code twice is one plug-in.
    """
    others = [other for other in others if other.digest != plugin.digest and other.path != plugin.path]
    for kind in taken:
        holders = {name.casefold(): (name, "a built-in name; choose another") for name in taken[kind]}
        for name in installed.names(kind):
            holders.setdefault(
                name.casefold(), (name, "already that of an installed package; choose another")
            )
        for other in others:
            holders |= {
                name.casefold(): (name, f"already that of {other.path}") for name in other.entries(kind)
            }
        for name in plugin.entries(kind):
            known, why = holders.setdefault(name.casefold(), (name, ""))
            if known != name:
                message = f"{kind}: '{name}' differs in capitals only from '{known}'; choose another"
                yield Problem(message, file=plugin.path)
            elif why:
                yield Problem(f"{kind}: '{name}' is {why}", file=plugin.path)
