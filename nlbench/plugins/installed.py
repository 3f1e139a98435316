"""Plug-ins that the user has installed: entry points of the groups `nlbench.systems` and `nlbench.filters`."""

from __future__ import annotations

import hashlib
import importlib.util
import logging
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from nlbench import runtime
from nlbench.blame import locate_step
from nlbench.errors import ConfigError, Problem
from nlbench.plugins.plugin import Kind, Plugin
from nlbench.plugins.signature import entry_of

log = logging.getLogger("nlbench")
_found: dict[tuple[str, str], Plugin] = {}  # by kind and name
_broken: set[tuple[str, str]] = set()  # those that were said to be


def names(kind: Kind) -> tuple[str, ...]:
    """Names of the installed systems or filters; nothing is imported."""
    return tuple(_points(kind))


def find(kind: Kind, name: str) -> Plugin | None:
    """The plug-in that an entry point names, imported; None where there is none. Raises `ConfigError`."""
    if (kind, name) not in _found:
        point = _points(kind).get(name)
        if point is None:
            return None
        _found[kind, name] = _loaded(kind, name, point)
    return _found[kind, name]


def works(kind: Kind, name: str) -> bool:
    """Whether a name is none that a broken plug-in brings; one that is broken is said, once."""
    try:
        find(kind, name)
    except ConfigError as error:
        if (kind, name) not in _broken:
            log.warning("%s; left out", error)
        _broken.add((kind, name))
        return False
    return True


def has(digest: str) -> bool:
    """Whether an installed plug-in with this code was found or can be; one that is broken is not it."""
    kinds: tuple[Kind, ...] = ("systems", "filters")
    return any(_is(point, digest) for kind in kinds for point in _points(kind).values())


@cache
def _points(kind: Kind) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=f"nlbench.{kind}")}


def _loaded(kind: Kind, name: str, point: EntryPoint) -> Plugin:
    where = f"{point.value} ({kind.removesuffix('s')} '{name}', installed)"
    runtime.prepare()
    try:
        factory = point.load()
    except (Exception, SystemExit) as error:
        raise ConfigError([locate_step(error, where, "importing it failed")]) from None
    entry = {name: entry_of(factory, kind, name, where)}
    systems, filters = (entry, {}) if kind == "systems" else ({}, entry)
    return Plugin(
        point.dist.name if point.dist else point.module, _digest(point), where, "", systems, filters
    )


def _is(point: EntryPoint, digest: str) -> bool:
    try:
        return _digest(point) == digest
    except (ConfigError, OSError, ValueError):
        return False


@cache
def _digest(point: EntryPoint) -> str:
    """Of every Python file of the package that holds the entry point, names included."""
    top = importlib.util.find_spec(point.module.split(".")[0])
    if top is None or top.origin is None:
        raise ConfigError([Problem("no such module; is the package still installed?", file=point.value)])
    origin = Path(top.origin)
    paths = sorted(origin.parent.rglob("*.py")) if top.submodule_search_locations else [origin]
    whole = hashlib.sha256()
    for path in paths:
        whole.update(path.relative_to(origin.parent).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return whole.hexdigest()[:16]
