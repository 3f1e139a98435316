"""Shapes of what a system's functions return, checked before anything is computed or compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.errors import ConfigError, Problem

if TYPE_CHECKING:
    from nlbench.systems.system import System


def check_shapes(system: System) -> None:
    """Raises `ConfigError` with a line for each shape that does not fit, got and expected."""
    n, m = system.states, system.measurements
    x = jnp.zeros(n)
    found = [
        *_array("initial.mean", system.initial.mean, (n,)),
        *_array("initial.cov", system.initial.cov, (n, n)),
        *_array("measurement_cov", system.measurement_cov, (m, m)),
        *_returned("drift", system.drift_with_inputs, x, (n,)),
        *_returned("observe", system.observe, x, (m,)),
    ]
    if system.diffusion is not None:
        s = None
        if system.diffusion_cov is not None:
            s = len(np.atleast_1d(system.diffusion_cov))
            found += _array("diffusion_cov", system.diffusion_cov, (s, s))
        found += _returned("diffusion", system.diffusion, x, (n, s))
    if found:
        raise ConfigError([Problem(each) for each in found])


def _array(name: str, array: Any, expected: tuple[int, ...]) -> list[str]:
    return _compared(name, np.shape(array), expected)


def _returned(name: str, function: Callable, x: Any, expected: tuple[int | None, ...]) -> list[str]:
    """`expected` may hold None, for any extent."""

    def value(x: Any) -> Any:
        y = function(0.0, x)
        return (
            jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
        )

    try:
        shape = jax.eval_shape(value, x).shape
    except Exception as error:
        return [
            f"{name}: raises {type(error).__name__} for x of shape {x.shape}: {str(error).splitlines()[0]}"
        ]
    return _compared(f"{name}(t, x)", shape, expected)


def _compared(name: str, shape: tuple[int, ...], expected: tuple[int | None, ...]) -> list[str]:
    fits = len(shape) == len(expected) and all(e in (None, s) for s, e in zip(shape, expected, strict=True))
    wanted = (
        "("
        + ", ".join("any" if e is None else str(e) for e in expected)
        + ("," if len(expected) == 1 else "")
        + ")"
    )
    return [] if fits else [f"{name}: got shape {shape}, expected {wanted}"]
