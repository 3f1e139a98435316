"""Small arrays taken apart: a jax function of arrays becomes scalar arithmetic on their elements.

`scalarise` walks a jaxpr with every array held as an integer array of node numbers; a node is a scalar, either a Python
number known at trace time or a 0-d jax array. Stacking, indexing and slicing then cost nothing, known values fold,
zeros vanish and equal subexpressions are formed once, so a function written with arrays depends, element by element,
on just what it must. An operation without a rule is applied to whole arrays: right, and dense in its dependence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.extend.core
import jax.numpy as jnp
import numpy as np

from nlbench.algebra.elementwise import ARITHMETIC, ELEMENTWISE, REDUCTIONS, array, bind
from nlbench.algebra.scalars import Scalar, is_known, multiply

Nodes = np.ndarray  # node numbers, in the shape of the array they stand for

# Operations that only move elements, with the operands that hold data, not indices (None: all of them).
MOVEMENT: dict[str, tuple[int, ...] | None] = {
    "broadcast_in_dim": (0,),
    "concatenate": None,
    "copy": (0,),
    "dynamic_slice": (0,),
    "dynamic_update_slice": (0, 1),
    "expand_dims": (0,),
    "gather": (0,),
    "pad": (0, 1),
    "reshape": (0,),
    "rev": (0,),
    "scatter": (0, 2),
    "slice": (0,),
    "split": (0,),
    "stack": None,
    "tile": (0,),
    "squeeze": (0,),
    "transpose": (0,),
    "unstack": (0,),
}
CALLS = ("jaxpr", "call_jaxpr", "fun_jaxpr")  # parameters that hold what is called
LOOPS = ("scan", "while", "cond")  # operations with such parameters that are no calls


def scalarise(
    function: Callable, *arguments: Sequence[Scalar] | Scalar, dtype: Any
) -> list[tuple[tuple, list]]:
    """The outputs of a function, taken apart.

    arguments: each a sequence of scalars standing for a vector of `dtype`, or one scalar.
    Returns the shape and the list of elements, in C order, of each array leaf of what the function returns; an element
    that is a Python number does not depend on any unknown argument.
    """
    walk = _Walk()
    numbers = [
        np.array([walk.node(s) for s in argument], int)
        if isinstance(argument, (list, tuple))
        else np.array(walk.node(argument))
        for argument in arguments
    ]
    closed = jax.make_jaxpr(function)(*(jax.ShapeDtypeStruct(number.shape, dtype) for number in numbers))
    outputs = walk.run(closed.jaxpr, closed.consts, numbers)
    return [(output.shape, walk.scalars(output)) for output in outputs]


class _Walk:
    """One pass over a jaxpr: the nodes, and the operations that formed them."""

    def __init__(self) -> None:
        self.nodes: list[Scalar] = []
        self.known: dict[Any, int] = {}
        self.formed: dict[Any, int] = {}
        self.multiples: dict[int, tuple[float, int]] = {}  # node -> known factor, node that it multiplies

    def node(self, scalar: Scalar) -> int:
        """The number of a scalar; equal known ones share it."""
        key = (type(scalar), scalar, math.copysign(1, scalar)) if is_known(scalar) else id(scalar)
        if key not in self.known:
            self.known[key] = len(self.nodes)
            self.nodes.append(scalar)
        return self.known[key]

    def scalars(self, nodes: Nodes) -> list[Scalar]:
        """The elements of an array in C order."""
        return [self.nodes[number] for number in nodes.reshape(-1)]

    def all_known(self, nodes: Nodes) -> bool:
        return all(map(is_known, self.scalars(nodes)))

    def run(self, jaxpr: Any, consts: Sequence[Any], arguments: Sequence[Nodes]) -> list[Nodes]:
        values: dict[Any, Nodes] = dict(zip(jaxpr.constvars, map(self.apart, consts), strict=True))
        values.update(zip(jaxpr.invars, arguments, strict=True))

        def read(atom: Any) -> Nodes:
            return self.apart(atom.val) if isinstance(atom, jax.extend.core.Literal) else values[atom]

        for equation in jaxpr.eqns:
            outputs = self.apply(equation, [read(atom) for atom in equation.invars])
            values.update(zip(equation.outvars, outputs, strict=True))
        return [read(atom) for atom in jaxpr.outvars]

    def apply(self, equation: Any, operands: list[Nodes]) -> list[Nodes]:
        name, params = equation.primitive.name, equation.params
        inner = next((params[key] for key in CALLS if key in params), None)
        if inner is not None and name not in LOOPS:
            return self.run(getattr(inner, "jaxpr", inner), getattr(inner, "consts", ()), operands)
        if name in ARITHMETIC:
            return [self.each(name, ARITHMETIC[name], operands)]
        if name in ELEMENTWISE:
            return [self.each((name, str(params)), lambda *scalars: bind(equation, scalars), operands)]
        if name in REDUCTIONS:
            return [self.reduced(name, operands[0], params["axes"])]
        if name == "dot_general":
            return [self.dot(operands[0], operands[1], params["dimension_numbers"])]
        if name in MOVEMENT:
            data = MOVEMENT[name] or range(len(operands))
            if all(self.all_known(operand) for place, operand in enumerate(operands) if place not in data):
                return self.moved(equation, operands, data)
        return self.whole(equation, operands)

    def operation(self, key: Any, function: Callable[..., Scalar], numbers: tuple[int, ...]) -> int:
        """The node that an operation on nodes gives, formed once."""
        if (key, numbers) not in self.formed:
            result = None if key != "mul" else self.multiple(*numbers)
            if result is None:
                result = self.node(function(*(self.nodes[number] for number in numbers)))
            self.formed[key, numbers] = result
        return self.formed[key, numbers]

    def multiple(self, a: int, b: int) -> int | None:
        """The product of a known number and a node, known factors gathered: c1 (c2 x) is (c1 c2) x."""
        if is_known(self.nodes[b]):
            a, b = b, a
        known = self.nodes[a]
        if not is_known(known) or is_known(self.nodes[b]) or known == 0:
            return None
        factor, base = self.multiples.get(b, (1.0, b))
        result = self.node(multiply(known * factor, self.nodes[base]))
        self.multiples.setdefault(result, (known * factor, base))
        return result

    def each(self, key: Any, function: Callable[..., Scalar], operands: Sequence[Nodes]) -> Nodes:
        """An operation on each tuple of elements, operands broadcast against each other."""
        shape = np.broadcast_shapes(*(operand.shape for operand in operands))
        rows = zip(
            *(np.broadcast_to(operand, shape).reshape(-1).tolist() for operand in operands), strict=True
        )
        return np.array([self.operation(key, function, numbers) for numbers in rows], int).reshape(shape)

    def reduced(self, name: str, operand: Nodes, axes: Sequence[int]) -> Nodes:
        function, start = REDUCTIONS[name]
        kept = [axis for axis in range(operand.ndim) if axis not in axes]
        rows = np.transpose(operand, (*kept, *axes)).reshape([operand.shape[axis] for axis in kept] + [-1])
        total = np.full(rows.shape[:-1], self.node(start))
        for place in range(rows.shape[-1]):
            total = self.each(name, function, [total, rows[..., place]])
        return total

    def dot(self, a: Nodes, b: Nodes, dimensions: Any) -> Nodes:
        (contract_a, contract_b), (batch_a, batch_b) = dimensions
        free_a = [axis for axis in range(a.ndim) if axis not in (*contract_a, *batch_a)]
        free_b = [axis for axis in range(b.ndim) if axis not in (*contract_b, *batch_b)]
        a = np.transpose(a, (*batch_a, *free_a, *contract_a))
        b = np.transpose(b, (*batch_b, *free_b, *contract_b))
        batch, summed = len(batch_a), a.ndim - len(contract_a)
        a = a.reshape(a.shape[:summed] + (1,) * len(free_b) + a.shape[summed:])
        b = b.reshape(b.shape[:batch] + (1,) * len(free_a) + b.shape[batch:])
        products = self.each("mul", multiply, np.broadcast_arrays(a, b))
        return self.reduced("reduce_sum", products, range(products.ndim - len(contract_a), products.ndim))

    def moved(self, equation: Any, operands: Sequence[Nodes], data: Sequence[int]) -> list[Nodes]:
        """Where the elements go: the node numbers themselves are moved; a fill out of bounds is zero."""
        zero = self.node(0.0)
        params = equation.params | ({"fill_value": 0} if "fill_value" in equation.params else {})
        with jax.ensure_compile_time_eval():
            numbers = [
                (operand + 1).astype(np.int32) if place in data else self.together(operand, atom.aval)
                for place, (operand, atom) in enumerate(zip(operands, equation.invars, strict=True))
            ]
            places = [
                np.asarray(result) - 1 for result in _listed(equation.primitive.bind(*numbers, **params))
            ]
        return [np.where(place < 0, zero, place) for place in places]

    def whole(self, equation: Any, operands: Sequence[Nodes]) -> list[Nodes]:
        """An operation without a rule, applied to whole arrays."""
        avals = [atom.aval for atom in equation.invars]
        arrays = [self.together(operand, aval) for operand, aval in zip(operands, avals, strict=True)]
        if all(map(self.all_known, operands)):
            with jax.ensure_compile_time_eval():
                return [self.apart(r) for r in _listed(equation.primitive.bind(*arrays, **equation.params))]
        return [self.apart(r) for r in _listed(equation.primitive.bind(*arrays, **equation.params))]

    def apart(self, array: Any) -> Nodes:
        """An array as node numbers; a concrete one gives Python numbers."""
        if isinstance(array, jax.core.Tracer):
            elements = [array[index] for index in np.ndindex(array.shape)]
        else:
            elements = np.asarray(array).reshape(-1).tolist()
        return np.array([self.node(element) for element in elements], int).reshape(np.shape(array))

    def together(self, nodes: Nodes, aval: Any) -> Any:
        """The array of the nodes."""
        if self.all_known(nodes):
            return np.array(self.scalars(nodes), aval.dtype).reshape(nodes.shape)
        return jnp.stack([array(s, aval.dtype) for s in self.scalars(nodes)]).reshape(nodes.shape)


def _listed(results: Any) -> Sequence[Any]:
    return results if isinstance(results, (list, tuple)) else [results]
