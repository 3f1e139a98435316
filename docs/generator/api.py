"""The reference of the Python interface: signatures and docstrings of what `nlbench` and its modules list as public."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import nlbench
from docs.generator.text import escaped

# What the public functions return or take, though nobody builds it by name.
RECORDS = (
    "nlbench.filters.filter.Filter",
    "nlbench.filters.filter.UpdateInfo",
    "nlbench.results.results.Results",
)


def page(written: str) -> str:
    """The page, after what was written by hand."""
    parts = [written.rstrip()]
    modules = []
    for name in nlbench.__all__:
        found = getattr(nlbench, name)
        if isinstance(found, ModuleType):
            modules.append((f"nb.{name}", found))
        else:
            parts += _entry(f"nb.{name}", found)
    for path in RECORDS:
        module, _, name = path.rpartition(".")
        parts += _entry(name, getattr(importlib.import_module(module), name))
    for name, module in modules:
        parts += [f"## {name}", _verbatim(module)]
        for member in _public(module):
            parts += _entry(f"{name}.{member}", getattr(module, member), level=3)
    return "\n\n".join(parts) + "\n"


def _public(module: ModuleType) -> list[str]:
    """What a module lists as public, or else the functions that it defines under public names."""
    defined = [
        name
        for name, found in vars(module).items()
        if inspect.isfunction(found) and found.__module__ == module.__name__ and not name.startswith("_")
    ]
    return list(getattr(module, "__all__", defined))


def _entry(name: str, found: Any, level: int = 2) -> Iterator[str]:
    yield f"{'#' * level} {name}"
    if callable(found):
        yield f"```text\n{name}{_signature(found)}\n```"
        yield _verbatim(found)
        yield from _members(found)
    else:
        yield escaped(f"= {found!r}")


def _members(found: Any) -> Iterator[str]:
    """Public methods and properties of a class that say something of themselves."""
    for name, member in vars(found).items() if inspect.isclass(found) else ():
        said = inspect.getdoc(member)
        if name.startswith("_") or name in getattr(found, "_fields", ()) or not said:
            continue
        if inspect.isfunction(member):
            yield f"`.{name}{_signature(member)}`\n: {escaped(' '.join(said.split()))}"
        elif hasattr(member, "fget") or hasattr(member, "func"):
            yield f"`.{name}`\n: {escaped(' '.join(said.split()))}"


def _signature(found: Any) -> str:
    try:
        signature = inspect.signature(found)
    except (TypeError, ValueError):
        return "(...)"
    kept = [
        each.replace(annotation=each.empty) for name, each in signature.parameters.items() if name != "self"
    ]
    return str(signature.replace(parameters=kept, return_annotation=signature.empty))


def _verbatim(found: Any) -> str:
    first, _, rest = (inspect.getdoc(found) or "").partition("\n\n")
    first, _, more = first.partition("\n")
    body = "\n\n".join(part for part in (more, rest) if part)
    return "\n\n".join(part for part in (escaped(first), f"```text\n{body}\n```" if body else "") if part)
