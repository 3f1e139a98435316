"""Traced functions as lists of operations: calls written out, equal operations formed once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax.extend.core import Literal

from nlbench.algebra.scalarise import CALLS, LOOPS

COMMUTATIVE = frozenset(("add", "add_any", "mul"))


class Operation(NamedTuple):
    """A primitive applied to variables and literals of the traced function."""

    primitive: Any
    params: dict[str, Any]
    operands: tuple[Any, ...]
    results: tuple[Any, ...]


class Variable:
    """A result; the same jaxpr called twice has the same variables in it, which stand for different values."""

    def __init__(self, aval: Any):
        self.aval = aval


def flattened(
    called: Any,
    arguments: Sequence[Any],
    operations: list[Operation],
    values: dict[Any, Any],
    formed: dict[Any, Any],
) -> list[Any]:
    """Appends the operations of a jaxpr, equal ones once and calls written out; returns its outputs.

    values: of variables that are known, to which the jaxpr's constants are added. formed: results by operation.
    """
    jaxpr, constants = getattr(called, "jaxpr", called), getattr(called, "consts", ())
    here = dict(zip(jaxpr.invars, arguments, strict=True))
    values.update(zip(jaxpr.constvars, constants, strict=True))

    def atom(v: Any) -> Any:
        return v if isinstance(v, Literal) else here.get(v, v)

    for equation in jaxpr.eqns:
        name, operands = equation.primitive.name, tuple(map(atom, equation.invars))
        inner = [equation.params[key] for key in CALLS if key in equation.params and name not in LOOPS]
        if inner:
            results: Sequence[Any] = flattened(inner[0], operands, operations, values, formed)
        else:
            named = [(repr(v.val), str(v.aval)) if isinstance(v, Literal) else v for v in operands]
            key = (name, frozenset(named) if name in COMMUTATIVE else tuple(named), str(equation.params))
            if key not in formed:
                formed[key] = fresh = tuple(Variable(v.aval) for v in equation.outvars)
                operations.append(Operation(equation.primitive, equation.params, operands, fresh))
            results = formed[key]
        here.update(zip(equation.outvars, results, strict=True))
    return list(map(atom, jaxpr.outvars))


def leading_to(wanted: Iterable[Any], operations: list[Operation], values: dict[Any, Any]) -> list[Operation]:
    """The operations that the wanted variables need beyond the known ones, in order."""
    needed = {v for v in variables(wanted) if v not in values}
    chosen = []
    for operation in reversed(operations):
        if not needed.isdisjoint(operation.results):
            needed.update(v for v in variables(operation.operands) if v not in values)
            chosen.append(operation)
    return chosen[::-1]


def computed(wanted: Sequence[Any], operations: list[Operation], values: dict[Any, Any]) -> list[Any]:
    """The wanted variables, from the known ones."""
    known = dict(values)

    def read(v: Any) -> Any:
        return v.val if isinstance(v, Literal) else known[v]

    for primitive, params, operands, results in leading_to(wanted, operations, values):
        made = primitive.bind(*map(read, operands), **params)
        known.update(zip(results, made if primitive.multiple_results else [made], strict=True))
    return [jnp.asarray(v.val) if isinstance(v, Literal) else known[v] for v in wanted]


def variables(atoms: Iterable[Any]) -> list[Any]:
    """Those that are not literals."""
    return [v for v in atoms if not isinstance(v, Literal)]
