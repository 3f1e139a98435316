"""One step of the classical fourth-order Runge-Kutta method, by which systems in discrete time move."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def step(rate: Callable, x: Any, h: float) -> Any:
    """x (n,) after a time h of dx/dt = rate(x)."""
    a = rate(x)
    b = rate(x + h / 2 * a)
    c = rate(x + h / 2 * b)
    d = rate(x + h * c)
    return x + h / 6 * (a + 2 * (b + c) + d)
