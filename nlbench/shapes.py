"""Shapes of arrays and of what functions return, got and expected; nothing is computed or compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from nlbench.errors import said

Shape = tuple[int | None, ...]  # None for any extent


def compared(name: str, shape: tuple[int, ...], expected: Shape) -> list[str]:
    """What is wrong with a shape: a line or none."""
    fits = len(shape) == len(expected) and all(e in (None, s) for s, e in zip(shape, expected, strict=True))
    wanted = str(expected).replace("None", "any")
    return [] if fits else [f"{name}: got shape {shape}, expected {wanted}"]


def returned(name: str, function: Callable, takes: tuple[Any, ...], expected: Shape) -> list[str]:
    """What is wrong with the shape of what a function returns, an array or a tuple of scalars: a line or none.

    takes: for each argument an array, or the shape of one (a number: a vector).
    """
    arguments = [each if hasattr(each, "shape") else jnp.zeros(each) for each in takes]
    try:
        shape = jax.eval_shape(lambda *x: stacked(function(*x)), *arguments).shape
    except Exception as error:
        shapes = " and ".join(f"shape {each.shape}" for each in arguments)
        return [f"{name}: raises {type(error).__name__} for {shapes}{said(error)}"]
    return compared(name, shape, expected)


def stacked(y: Any) -> Any:
    """An array, also where a system returned a tuple of scalars."""
    return jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
