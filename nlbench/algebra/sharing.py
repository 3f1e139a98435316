"""Shared values formed once: a long function of scalars, computed in steps that XLA keeps apart.

XLA's CPU compiler makes a loop over the lanes for each result of a function and forms again, in each, what several of
them share: for the rates of thirty moments, the derivatives of the drift thirty times. `shared` finds the values that
several results need and that cost more than reading them back, and computes them before, in the branch of a condition
that always holds, which XLA can neither foresee nor fuse with what follows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from nlbench.algebra.operations import Operation, computed, flattened, leading_to, variables

KEEP_ABOVE = 4  # operations that keeping a value saves: below, storing it and reading it back costs as much
DEAR = 10  # operations that a division, a root, or whatever else is not listed below, counts for
CHEAP = frozenset("abs add add_any and eq ge gt is_finite le lt max min mul ne not or select_n sub".split())
FREE = frozenset("broadcast_in_dim convert_element_type copy neg reshape squeeze".split())


def shared(function: Callable, clock: Any, *arguments: Any, reused: bool = False) -> Any:
    """function(*arguments), with what its results share formed once.

    clock: a number that XLA cannot foresee, such as the time. arguments, results: pytrees of arrays, scalars mostly.
    reused: whether the results themselves serve more than one purpose afterwards, and so are kept too.
    """
    leaves, structure = jax.tree.flatten(arguments)
    if not any(isinstance(leaf, jax.core.Tracer) for leaf in leaves):
        return function(*arguments)  # nothing is compiled
    shapes: list[Any] = []

    def flat(*leaves: Any) -> list[Any]:
        results, shape = jax.tree.flatten(function(*jax.tree.unflatten(structure, leaves)))
        shapes.append(shape)
        return results

    closed = jax.make_jaxpr(flat)(*leaves)
    operations: list[Operation] = []
    values: dict[Any, Any] = dict(zip(closed.jaxpr.invars, leaves, strict=True))
    outputs = flattened(closed, closed.jaxpr.invars, operations, values, {})
    operations = leading_to(outputs, operations, values)
    for step in _steps(operations, outputs, reused):
        kept = jax.lax.cond(
            clock == clock,
            lambda step=step: computed(step, operations, values),
            lambda step=step: [jnp.zeros(v.aval.shape, v.aval.dtype) for v in step],
        )
        values.update(zip(step, kept, strict=True))
    return jax.tree.unflatten(shapes[0], computed(outputs, operations, values))


def _steps(operations: list[Operation], outputs: list[Any], reused: bool) -> list[list[Any]]:
    """The variables to be kept, step by step: each step needs those of the steps before only."""
    maker = {v: number for number, operation in enumerate(operations) for v in operation.results}
    needs = [{maker[v] for v in variables(o.operands) if v in maker} for o in operations]
    ends = {maker[v] for v in variables(outputs) if v in maker}
    kept = _kept(operations, needs, ends) | (ends if reused else set())
    depth: list[int] = []
    for before in needs:
        depth.append(max((depth[b] + (b in kept) for b in before), default=0))
    steps: dict[int, list[Any]] = {}
    for number in sorted(kept):
        steps.setdefault(depth[number], []).extend(operations[number].results)
    return [steps[level] for level in sorted(steps)]


def _kept(operations: list[Operation], needs: list[set[int]], ends: set[int]) -> set[int]:
    """Operations whose results are to be kept, by number.

    First those that would be repeated for each operation that uses them; of these, those remain that would be repeated
    for results that XLA forms apart: outputs (`ends`), and what is kept.
    """
    users: list[set[int]] = [set() for _ in operations]
    for number, before in enumerate(needs):
        for operand in before:
            users[operand].add(number)
    kept: set[int] = set()
    within: list[set[int]] = []  # the operations that a value takes, from kept ones on
    cost: list[int] = []
    for number, before in enumerate(needs):
        within.append({number}.union(*(within[b] for b in before - kept)))
        cost.append(sum(_weight(operations[b]) for b in within[number]))
        if (len(users[number]) - 1 + (number in ends)) * cost[number] > KEEP_ABOVE:
            kept.add(number)
    apart: list[set[int]] = [set() for _ in operations]
    for number in reversed(range(len(operations))):
        for user in users[number]:
            apart[number] |= {user} if user in kept or user in ends else apart[user]
        if (len(apart[number]) - 1 + (number in ends)) * cost[number] <= KEEP_ABOVE:
            kept.discard(number)
    return kept


def _weight(operation: Operation) -> int:
    name = operation.primitive.name
    return 0 if name in FREE else 1 if name in CHEAP else DEAR
