"""Tables of the fields of pydantic models: what each takes, its default, what it means."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel

from docs.generator.text import cell, escaped, table
from nlbench.config.explain import expected, found, plain

HEAD = ("key", "takes", "default", "meaning")


def of(model: type[BaseModel], without: tuple[str, ...] = ()) -> str:
    """The table of a model's fields, and below it those of the models that its fields hold."""
    rows, parts = [], []
    for name, field in model.model_fields.items():
        if name in without:
            continue
        default = plain(field.get_default(call_default_factory=True)) if not field.is_required() else None
        shown = "required" if field.is_required() else _default(default)
        takes = cell(expected(field.annotation, tuple(field.metadata)))
        rows.append((f"`{name}`", takes, shown, cell(field.description or "")))
        for inner in _models(field.annotation):
            parts.append(f"`{name}` as a mapping:\n\n{of(inner)}")
    if not rows:
        return "None."
    return "\n\n".join([table(HEAD, rows), *parts])


def _default(value: Any) -> str:
    """A default as the file would state it; None is left empty."""
    if isinstance(value, dict):
        given = ", ".join(f"{key}: {each}" for key, each in value.items() if each is not None)
        return f"`{{{given}}}`"
    if isinstance(value, (list, str)):
        return f"`{value}`"
    return "" if value is None else escaped(found(value))


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    else:
        for member in get_args(annotation):
            yield from _models(member)
