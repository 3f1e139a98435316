"""Whether what a function returns depends on its first argument, told from its program."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
from jax.interpreters.partial_eval import dce_jaxpr


def depends(function: Callable, *arguments: Any) -> bool:
    """Whether function(*arguments) needs arguments[0], an array or a number. What only multiplies by zero counts."""
    program = jax.make_jaxpr(function)(*arguments).jaxpr
    return dce_jaxpr(program, [True] * len(program.outvars))[1][0]
