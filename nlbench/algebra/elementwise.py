"""Operations on single scalars: which ones act element by element, and those that fold where values are known."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra.scalars import Scalar, add, is_known, multiply

ELEMENTWISE = frozenset(
    "abs acos acosh and asin asinh atan atan2 atanh cbrt ceil clamp convert_element_type cos cosh digamma div eq erf "
    "erf_inv erfc exp exp2 expm1 floor ge gt integer_pow is_finite le lgamma log log1p logistic lt max min ne "
    "nextafter not or pow rem round rsqrt select_n sign sin sinh sqrt square tan tanh xor".split()
)
REDUCTIONS: dict[str, tuple[Callable[[Scalar, Scalar], Scalar], Scalar]] = {
    "reduce_sum": (add, 0.0),
    "reduce_prod": (multiply, 1.0),
}
ARITHMETIC: dict[str, Callable[..., Scalar]] = {
    "add": add,
    "add_any": add,
    "sub": lambda a, b: (
        a - b if not any(is_known(s) and s == 0 for s in (a, b)) else add(a, multiply(-1.0, b))
    ),
    "mul": multiply,
    "neg": lambda a: multiply(-1.0, a),
    "stop_gradient": lambda a: a,
}


def bind(equation: Any, scalars: Sequence[Scalar]) -> Scalar:
    """One elementwise operation on scalars, folded where it can be."""
    folded = _folded(equation.primitive.name, scalars, equation.params)
    if folded is not None:
        return folded
    arrays = [array(s, atom.aval.dtype) for s, atom in zip(scalars, equation.invars, strict=True)]
    if not all(map(is_known, scalars)):
        return equation.primitive.bind(*arrays, **equation.params)
    with jax.ensure_compile_time_eval():
        return equation.primitive.bind(*arrays, **equation.params).item()


def _folded(name: str, scalars: Sequence[Scalar], params: dict) -> Scalar | None:
    """The result where it needs less than the operation; None otherwise."""
    first, known = scalars[0], is_known(scalars[0])
    if name == "convert_element_type" and not known and first.dtype == params["new_dtype"]:
        return first
    if name == "div" and known and first == 0:
        return 0.0
    if name == "div" and not known and is_known(scalars[1]) and math.frexp(scalars[1])[0] in (-0.5, 0.5):
        return multiply(1.0 / scalars[1], first)  # a power of two, so exact
    if name == "integer_pow" and not known and params["y"] in (1, 2, 3):
        return {1: first, 2: first * first, 3: first * first * first}[params["y"]]
    if name == "square" and not known:
        return first * first
    if name == "select_n" and known:
        return scalars[1 + int(first)]
    if name == "select_n" and all(is_known(case) and case == scalars[1] for case in scalars[1:]):
        return scalars[1]
    return None


def array(scalar: Scalar, dtype: Any) -> Any:
    """A scalar as a 0-d array; a known one stays a NumPy array."""
    return np.asarray(scalar, dtype) if is_known(scalar) else jnp.asarray(scalar, dtype)
