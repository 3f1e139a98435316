"""Points at which a function or a derivative of it may not be finite, found without taking derivatives.

Sums, products, sines and the like have derivatives wherever they have values; roots, logarithms, quotients and powers
have not where an argument is zero. So the arguments of those few operations decide, which costs a fraction of what
compiling second derivatives costs, and nothing where a function has none of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import Literal

# Operation -> whether a value or a derivative is not finite, given its operands.
RISKS: dict[str, Callable[..., Any]] = {
    "sqrt": lambda x: x == 0,
    "rsqrt": lambda x: x == 0,
    "cbrt": lambda x: x == 0,
    "log": lambda x: x == 0,
    "log1p": lambda x: x == -1,
    "div": lambda x, y: y == 0,
    "rem": lambda x, y: y == 0,
    "pow": lambda x, y: x <= 0,
    "integer_pow": lambda x: x == 0,
    "atan2": lambda y, x: (x == 0) & (y == 0),
    "asin": lambda x: jnp.abs(x) >= 1,
    "acos": lambda x: jnp.abs(x) >= 1,
    "atanh": lambda x: jnp.abs(x) >= 1,
    "acosh": lambda x: x <= 1,
}
# Of these nothing is told; nor of an operation that holds a program of its own, but for those that only call it.
OPAQUE = frozenset(
    "cholesky digamma eig eigh erf_inv householder_product lgamma lu polygamma qr schur svd triangular_solve "
    "tridiagonal_solve".split()
)
CALLS = ("jit", "pjit", "checkpoint")
HOLDER = "holder"  # in place of the name of an operation that holds a program


def may_be_singular(function: Callable, *arguments: Any) -> bool:
    """Return whether function(*arguments), or a derivative of it, may not be finite there; False is certain, but for
    numbers beyond the range of floats."""
    closed = jax.make_jaxpr(function)(*arguments)
    named = set(_names(closed.jaxpr))
    if named & {*OPAQUE, HOLDER}:
        return True
    if not named & set(RISKS):
        return False

    def risk(*given: Any) -> Any:
        found: list[Any] = []
        results = _evaluated(closed.jaxpr, closed.consts, given, found)
        return jnp.any(jnp.stack([*found, *(~jnp.all(jnp.isfinite(each)) for each in results)]))

    quickly = {"xla_backend_optimization_level": 0}  # it runs once
    return bool(jax.jit(risk, compiler_options=quickly)(*jax.tree.leaves(arguments)))


def _names(program: Any) -> Iterator[str]:
    """Names of the operations of a program and of those that it calls, without those that are harmless."""
    for equation in program.eqns:
        if equation.primitive.name in CALLS:
            yield from _names(_called(equation)[0])
        elif any(hasattr(value, "eqns") or hasattr(value, "jaxpr") for value in _values(equation)):
            yield HOLDER
        elif not _is_harmless(equation):
            yield equation.primitive.name


def _called(equation: Any) -> tuple[Any, Sequence[Any]]:
    """The program that an operation of `CALLS` calls, and its constants."""
    closed = equation.params["jaxpr"]
    return getattr(closed, "jaxpr", closed), getattr(closed, "consts", ())


def _values(equation: Any) -> Iterator[Any]:
    for value in equation.params.values():
        yield from value if isinstance(value, (tuple, list)) else (value,)


def _is_harmless(equation: Any) -> bool:
    """Whether it is a division by a number or a whole power."""
    name = equation.primitive.name
    if name == "integer_pow":
        return bool(equation.params["y"] >= 0)
    last = equation.invars[-1] if equation.invars else None
    return name in ("div", "rem") and isinstance(last, Literal) and bool(last.val != 0)


def _evaluated(program: Any, constants: Sequence[Any], given: Sequence[Any], found: list[Any]) -> list[Any]:
    """What a program returns; to `found` is added, for each operation at risk, whether it is where it must not be."""
    known = dict(zip([*program.constvars, *program.invars], [*constants, *given], strict=True))

    def read(atoms: Sequence[Any]) -> list[Any]:
        return [atom.val if isinstance(atom, Literal) else known[atom] for atom in atoms]

    for equation in program.eqns:
        operands, primitive = read(equation.invars), equation.primitive
        if primitive.name in CALLS:
            results = _evaluated(*_called(equation), operands, found)
        else:
            if primitive.name in RISKS and not _is_harmless(equation):
                found.append(jnp.any(RISKS[primitive.name](*operands)))
            results = primitive.bind(*operands, **equation.params)
            results = results if primitive.multiple_results else [results]
        known.update(zip(equation.outvars, results, strict=True))
    return read(program.outvars)
