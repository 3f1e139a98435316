"""Taylor expansion of f(x, w) about (x, 0): values, Jacobians and Hessians as full arrays, by jax.

f(x + e, w) = value + Fx e + Fw w + Fxx:ee/2 + Fww:ww/2 + e Fxw w + ...
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.discrete.problem import stacked

if TYPE_CHECKING:
    from nlbench.systems.system import System


class First(NamedTuple):
    """value (n,), Jacobians x (n, n) and w (n, s)."""

    value: Any
    x: Any
    w: Any


class Second(NamedTuple):
    """Hessians, first index that of f: xx (n, n, n), ww (n, s, s), xw (n, n, s)."""

    xx: Any
    ww: Any
    xw: Any


def first(function: Callable, t: Any, x: Any, s: int) -> First:
    """Value and Jacobians of function(t, x, w) at w = 0, w (s,)."""
    w = jnp.zeros(s)
    return First(function(t, x, w), *jax.jacfwd(function, (1, 2))(t, x, w))


def second(function: Callable, t: Any, x: Any, s: int) -> Second:
    """Hessians of function(t, x, w) at w = 0, w (s,)."""
    (xx, xw), (_, ww) = jax.jacfwd(jax.jacfwd(function, (1, 2)), (1, 2))(t, x, jnp.zeros(s))
    return Second(xx, ww, xw)


def drift(system: System, t: Any, x: Any) -> tuple[Any, Any]:
    """f(t, x) of a system in continuous time and its Jacobian: (n,), (n, n)."""
    f = lambda x: stacked(system.drift_with_inputs(t, x))  # noqa: E731
    return f(x), jax.jacfwd(f)(x)


def curvature(system: System, t: Any, x: Any) -> Any:
    """The Hessian of f(t, x) of a system in continuous time: (n, n, n)."""
    return jax.jacfwd(jax.jacfwd(lambda x: stacked(system.drift_with_inputs(t, x))))(x)
