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


def refuse_exact(name: str, measurement_cov: Any) -> None:
    """Raises `ConfigError` for a filter that divides by the noise of measurements, where a direction has none."""
    import jax
    import numpy as np

    if isinstance(measurement_cov, jax.core.Tracer):
        return
    values, vectors = np.linalg.eigh(np.asarray(measurement_cov, float))
    if values[0] <= len(values) * np.finfo(float).eps * abs(values[-1]):
        entry = int(np.argmax(np.abs(vectors[:, 0])))
        raise ConfigError(
            f"{name}: measurement_cov has the eigenvalue {values[0]:.3g} (entry [{entry}, {entry}]), and this filter "
            "needs noise in every direction of a measurement; give it a variance, or take ekf, iekf, ukf or sof"
        )
