"""Checks of names and parameters that a caller gives, with the closest known name in the message."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from nlbench.errors import ConfigError, Problem
from nlbench.suggestions import suggestion

if TYPE_CHECKING:
    from pydantic import BaseModel

    Model = TypeVar("Model", bound=BaseModel)


def known(name: str, names: Iterable[str], what: str) -> str:
    """`name`, if it is one of `names`. Raises `ConfigError` otherwise."""
    if name not in names:
        raise ConfigError(f"unknown {what} '{name}'{suggestion(name, names)}")
    return name


def checked(model: type[Model], values: Mapping[str, Any], where: str) -> Model:
    """`values` as an instance of `model`. Raises `ConfigError` with a line for each problem."""
    from pydantic import ValidationError

    try:
        return model(**values)
    except ValidationError as error:
        lines = []
        for problem in error.errors():
            path = ".".join(str(part) for part in problem["loc"])
            if problem["type"] == "extra_forbidden":
                lines.append(f"{where}.{path}: unknown{suggestion(path, model.model_fields)}")
            else:
                lines.append(f"{where}.{path}: {problem['msg']} (got {problem['input']!r})")
        raise ConfigError([Problem(line) for line in lines]) from None
