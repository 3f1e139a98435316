"""What a factory takes, as a pydantic model: its own model, or one made of its keyword arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, PositiveFloat, create_model

from nlbench.errors import ConfigError, Problem, said
from nlbench.plugins.plugin import Entry, Kind
from nlbench.row import StrictOptions

# What the engine tells every filter; a factory that has no use for them need not take them.
TOLD: dict[str, Any] = {
    "step": (
        PositiveFloat | None,
        Field(default=None, description="integration step; default: the experiment's"),
    ),
    "missing": (bool, Field(default=True, description="whether measurements may be NaN, meaning not taken")),
}
# Keys that stand beside the parameters in an experiment file, and mean something else.
RESERVED = {"systems": ("name",), "filters": ("name", "label", "model", "initial")}
TAKES = {
    "systems": "(parameter=default, ...) or one pydantic model",
    "filters": "(system, option=default, ...) or (system, options), options a pydantic model",
}


class Strict(BaseModel):
    """What a plug-in's own model becomes too: unknown keys, and numbers that are not finite, are mistakes."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


def entry_of(factory: Any, kind: Kind, name: str, path: str) -> Entry:
    """The entry that a factory declares. Raises `ConfigError` where its signature says no parameters."""
    where = f"{kind.removesuffix('s')} '{name}'"
    if not callable(factory):
        raise _wrong(path, f"{where}: expected a function, found {type(factory).__name__}")
    try:
        given = list(inspect.signature(factory).parameters.values())
        hints = get_type_hints(factory, include_extras=True)
    except Exception as error:  # annotations are code
        message = (
            f"{where}: its signature cannot be read: {_unread(factory)}{type(error).__name__}{said(error)}"
        )
        raise _wrong(path, message, factory) from None
    leading = 1 if kind == "filters" else 0
    shown = f"{getattr(factory, '__name__', name)}{inspect.signature(factory)}"
    if len(given) < leading or any(each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD) for each in given):
        raise _wrong(path, f"{where}: wrong signature: expected {TAKES[kind]}, found {shown}", factory)
    own = given[leading:]
    base = hints.get(own[0].name) if len(own) == 1 else None
    if isinstance(base, type) and issubclass(base, BaseModel):
        model, takes_model = _strict(base, where, path, factory), True
    else:
        model, takes_model = _model(own, hints, where, path, factory), False
    reserved = [name for name in model.model_fields if name in RESERVED[kind]]
    if reserved:
        message = f"{where}: '{reserved[0]}' means something else beside its name in an experiment; rename it"
        raise _wrong(path, message, factory)
    told = TOLD if kind == "filters" else {}
    missing = {key: value for key, value in told.items() if key not in model.model_fields}
    full = create_model(model.__name__, __base__=model, **missing) if missing else model
    summary = (inspect.getdoc(factory) or "").split("\n")[0] or f"of {path}"
    return Entry(summary, full, _called(factory, [each.name for each in own], takes_model))


def _unread(factory: Any) -> str:
    """The annotation of a function that cannot be read, if it is one of those."""
    names = getattr(inspect.unwrap(factory), "__globals__", {})
    for name, annotation in getattr(factory, "__annotations__", {}).items():
        alone = SimpleNamespace(__annotations__={name: annotation}, __globals__=names)
        try:
            get_type_hints(alone)
        except Exception:
            of = "what it returns" if name == "return" else f"'{name}'"
            return f"annotation {annotation!r} of {of}: "
    return ""


def _strict(model: type[BaseModel], where: str, path: str, factory: Any) -> type[BaseModel]:
    """A model of the plug-in's own that refuses what all options refuse."""
    try:
        return create_model(model.__name__, __base__=(model, Strict))
    except Exception as error:
        message = f"{where}: {model.__name__} is no model of named parameters{said(error)}"
        raise _wrong(path, message, factory) from None


def _called(factory: Callable, names: list[str], takes_model: bool) -> Callable:
    def call(*arguments: Any) -> Any:
        *leading, values = arguments
        if takes_model:
            return factory(*leading, values)
        return factory(*leading, **{name: getattr(values, name) for name in names})

    return call


def _model(own: list[Any], hints: dict[str, Any], where: str, path: str, factory: Any) -> type[BaseModel]:
    """The model of keyword arguments; what has no annotation is of the type of its default."""
    fields: dict[str, Any] = {}
    for each in own:
        without = each.default is each.empty
        of = hints.get(each.name, Any if without or each.default is None else type(each.default))
        if each.kind is each.POSITIONAL_ONLY or each.name.startswith(("_", "model_")):
            raise _wrong(path, f"{where}: wrong signature: '{each.name}' cannot be given by name", factory)
        fields[each.name] = (of, ... if without else each.default)
    try:
        return create_model("Parameters", __base__=StrictOptions, **fields)
    except Exception as error:
        message = "parameters must be float, int, bool, str, or lists or tuples of them"
        raise _wrong(path, f"{where}: {message} ({said(error)[2:]})", factory) from None


def _wrong(path: str, message: str, factory: Any = None) -> ConfigError:
    line = getattr(getattr(factory, "__code__", None), "co_firstlineno", None)
    return ConfigError([Problem(message, file=path, line=line)])
