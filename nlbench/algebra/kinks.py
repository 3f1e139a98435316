"""Where a function breaks: kinks and jumps, of which its derivatives by jax say nothing.

The derivative of |x| is sign x, whose derivative is zero: by its second derivatives |x| is a straight line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.extend.core import Literal
from jax.interpreters.partial_eval import dce_jaxpr

from nlbench.algebra.scalarise import scalarise
from nlbench.algebra.scalars import is_known

KINKS = frozenset(
    "abs ceil clamp cummax cummin floor max min nextafter reduce_max reduce_min rem round sign sort top_k".split()
)


def breaks(function: Callable, p: int, n: int) -> bool:
    """Return whether function(given, z), for given (p,) and z (n,), has a kink or a jump in z, told from its program.

    An operation counts whose result is not a number, such as a comparison or an index, and one of `KINKS`, where what
    it is applied to depends on z, element by element.
    """

    def elements(given: Any, z: Any) -> list[Any]:
        parts = scalarise(lambda given, z: function(given, z), list(given), list(z), dtype=float)
        return [jnp.asarray(each) for _, scalars in parts for each in scalars if not is_known(each)]

    program = jax.make_jaxpr(elements)(jnp.zeros(p), jnp.zeros(n)).jaxpr
    needed, _ = dce_jaxpr(program, [True] * len(program.outvars), instantiate=True)
    return _walked(needed, [False, True])[1]


def _walked(program: Any, depends: Sequence[bool]) -> tuple[list[bool], bool]:
    """Which results depend on the arguments that do, and whether one breaks on the way."""
    known = dict(zip(program.invars, depends, strict=True))
    broken = False

    def read(atom: Any) -> bool:
        return not isinstance(atom, Literal) and known.get(atom, False)

    for equation in program.eqns:
        taken = [read(atom) for atom in equation.invars]
        results, breaking = (
            _applied(equation, taken) if any(taken) else ([False] * len(equation.outvars), False)
        )
        broken |= breaking
        known.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in program.outvars], broken


def _applied(equation: Any, taken: list[bool]) -> tuple[list[bool], bool]:
    """The same of one operation, to which one operand at least depends."""
    name, params, count = equation.primitive.name, equation.params, len(equation.outvars)
    if name == "cond":
        branches = [_walked(each.jaxpr, taken[1:]) for each in params["branches"]]
        results = [any(each) for each in zip(*(results for results, _ in branches), strict=True)]
        return results, taken[0] or any(breaking for _, breaking in branches)
    if name == "scan":
        return _repeated(params["jaxpr"].jaxpr, taken, params["num_consts"], params["num_carry"])
    if name == "while":
        consts = params["cond_nconsts"], params["body_nconsts"]
        of_test, of_body, carry = taken[: consts[0]], taken[consts[0] : sum(consts)], taken[sum(consts) :]
        results, breaking = _repeated(params["body_jaxpr"].jaxpr, [*of_body, *carry], consts[1], len(carry))
        tested = _walked(params["cond_jaxpr"].jaxpr, [*of_test, *results])[0][0]
        return results, breaking or tested
    inner = next((params[key] for key in ("jaxpr", "call_jaxpr", "fun_jaxpr") if key in params), None)
    if inner is not None:
        return _walked(getattr(inner, "jaxpr", inner), taken)
    numbers = all(jnp.issubdtype(out.aval.dtype, jnp.inexact) for out in equation.outvars)
    return [True] * count, name in KINKS or not numbers


def _repeated(body: Any, taken: list[bool], consts: int, carried: int) -> tuple[list[bool], bool]:
    """A loop's results: what the carry depends on after however many rounds, and what is stacked."""
    while True:
        results, breaking = _walked(body, taken)
        carry = [a or b for a, b in zip(taken[consts : consts + carried], results[:carried], strict=True)]
        if carry == taken[consts : consts + carried]:
            return [*carry, *results[carried:]], breaking
        taken = [*taken[:consts], *carry, *taken[consts + carried :]]
