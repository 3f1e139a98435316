"""What a factory takes, as a pydantic model: its own model, or one made of its keyword arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, get_type_hints

from pydantic import BaseModel, Field, PositiveFloat, create_model

from nlbench.errors import ConfigError, Problem
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
TAKES = {
    "systems": "(parameter=default, ...) or one pydantic model",
    "filters": "(system, option=default, ...) or (system, options), options a pydantic model",
}


def entry_of(factory: Any, kind: Kind, name: str, path: str) -> Entry:
    """The entry that a factory declares. Raises `ConfigError` where its signature says no parameters."""
    where = f"{kind.removesuffix('s')} '{name}'"
    if not callable(factory):
        raise _wrong(path, f"{where}: expected a function, found {type(factory).__name__}")
    try:
        given = list(inspect.signature(factory).parameters.values())
        hints = get_type_hints(factory, include_extras=True)
    except (TypeError, ValueError, NameError) as error:
        raise _wrong(path, f"{where}: its signature cannot be read: {error}", factory) from None
    leading = 1 if kind == "filters" else 0
    shown = f"{getattr(factory, '__name__', name)}{inspect.signature(factory)}"
    if len(given) < leading or any(each.kind in (each.VAR_POSITIONAL, each.VAR_KEYWORD) for each in given):
        raise _wrong(path, f"{where}: wrong signature: expected {TAKES[kind]}, found {shown}", factory)
    own = given[leading:]
    base = hints.get(own[0].name) if len(own) == 1 else None
    if isinstance(base, type) and issubclass(base, BaseModel):
        model, takes_model = base, True
    else:
        model, takes_model = _model(own, hints, where, path, factory), False
    told = TOLD if kind == "filters" else {}
    missing = {key: value for key, value in told.items() if key not in model.model_fields}
    full = create_model(model.__name__, __base__=model, **missing) if missing else model
    summary = (inspect.getdoc(factory) or "").split("\n")[0] or f"of {path}"
    return Entry(summary, full, _called(factory, [each.name for each in own], takes_model))


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
        raise _wrong(path, f"{where}: {message} ({str(error).splitlines()[0]})", factory) from None


def _wrong(path: str, message: str, factory: Any = None) -> ConfigError:
    line = getattr(getattr(factory, "__code__", None), "co_firstlineno", None)
    return ConfigError([Problem(message, file=path, line=line)])
