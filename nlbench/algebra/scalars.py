"""Arithmetic of one component: a Python number known at trace time, or a 0-d jax array. Known zeros and ones fold."""

from __future__ import annotations

from typing import Any

Scalar = Any  # a Python float, or a 0-d array


def is_known(value: Scalar) -> bool:
    """Whether the value is a Python number, so known at trace time."""
    return isinstance(value, (int, float))


def add(a: Scalar, b: Scalar) -> Scalar:
    """a + b."""
    if is_known(a) and a == 0:
        return b
    if is_known(b) and b == 0:
        return a
    return a + b


def multiply(a: Scalar, b: Scalar) -> Scalar:
    """a b, where a known zero wins over everything: a structural zero stays one whatever it multiplies."""
    for known, other in ((a, b), (b, a)):
        if is_known(known):
            if known == 0:
                return 0.0
            if known == 1:
                return other
            if known == -1:
                return -other
    return a * b
