"""Calls of a user's function by shapes: what is wrong with its arguments, with itself or with what it returns.

Nothing is computed or compiled. Every argument is traced, the time too, as it will be in a run.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from itertools import permutations
from typing import Any

import jax
import jax.numpy as jnp

from nlbench.blame import explain, locate
from nlbench.errors import Problem
from nlbench.shapes import Floats, Shape, compared, stacked


class _ReturnsNone(Exception):
    """The function came to its end without a value."""


def returned(name: str, function: Callable, takes: Sequence[Any], expected: Shape | None) -> list[Problem]:
    """Say what is wrong with a function or the shape of what it returns, an array or a tuple of scalars: a problem or
    none.

    name: with its arguments, as "drift(t, x)". takes: for each argument an array or a number, or the shape of an array,
    and perhaps known inputs after them. expected: None for anything.
    """
    letters = name.partition("(")[2].rstrip(")").split(", ")
    arguments = [jnp.zeros(each) if isinstance(each, tuple) else each for each in takes]
    named = _parameters(function)
    order = named[: len(letters)]
    if order != letters and sorted(order) == sorted(letters):
        return [locate(function, _in_another_order(name, letters, order))]
    if not _binds(function, arguments):
        wanted = ", ".join([*letters, *["u"] * (len(arguments) - len(letters))])
        return [locate(function, f"{name}: takes ({', '.join(named)}), and is called with ({wanted})")]
    try:
        result = _result(function, arguments, stacked if expected is not None else None)
    except _ReturnsNone:
        return [locate(function, f"{name}: returns None; a `return` is missing")]
    except Exception as error:
        hint = None if order == letters else _swapped(name, function, arguments, letters, expected)
        shapes = " and ".join(f"shape {each}" for each in takes if isinstance(each, tuple))
        return [hint or explain(error, name, function, shapes)]
    if expected is None:
        return []
    wrong = compared(name, result.shape, expected)
    if jnp.issubdtype(result.dtype, jnp.complexfloating):
        wrong = [f"{name}: returns complex numbers, expected real ones"]
    # A number is taken for a vector of one; it may be one because the time was taken for the state.
    doubtful = wrong or (isinstance(function, Floats) and _fits(function.function, arguments, ()))
    if doubtful and order != letters and (hint := _swapped(name, function, arguments, letters, expected)):
        return [hint]
    return [locate(function, each) for each in wrong]


def _in_another_order(name: str, letters: Sequence[str], order: Sequence[str]) -> str:
    """Say that a function takes its arguments in another order."""
    return (
        f"{name}: takes its arguments as ({', '.join(order)}); they come as ({', '.join(letters)}), "
        "so write it in that order"
    )


def _parameters(function: Callable) -> list[str]:
    """Names of the arguments that a function takes by place; none where they cannot be read."""
    try:
        given = inspect.signature(_bare(function)).parameters.values()
    except (TypeError, ValueError):
        return []
    return [each.name for each in given if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]


def _binds(function: Callable, arguments: Sequence[Any]) -> bool:
    """Whether a function can be called with that many arguments, as far as can be read."""
    try:
        signature = inspect.signature(_bare(function))
    except (TypeError, ValueError):
        return True
    try:
        signature.bind(*arguments)
    except TypeError:
        return False
    return True


def _bare(function: Callable) -> Callable:
    """The function as the user gave it."""
    return function.function if isinstance(function, Floats) else function


def _swapped(
    name: str, function: Callable, arguments: Sequence[Any], letters: Sequence[str], expected: Shape | None
) -> Problem | None:
    """Say in which other order of its arguments a function returns just what is expected; None where there is
    none."""
    count = len(letters)
    for places in list(permutations(range(count)))[1:] if expected is not None else []:
        order = [arguments[place] for place in places] + list(arguments[count:])
        if _fits(_bare(function), order, expected):
            return locate(function, _in_another_order(name, letters, [letters[place] for place in places]))
    return None


def _fits(function: Callable, arguments: Sequence[Any], expected: Shape) -> bool:
    try:
        return not compared("", _result(function, arguments).shape, expected)
    except Exception:
        return False


def _result(function: Callable, arguments: Sequence[Any], formed: Callable | None = stacked) -> Any:
    """Shape and type of function(*arguments), formed to an array or not."""

    def called(*arguments: Any) -> Any:
        y = function(*arguments)
        if y is None:
            raise _ReturnsNone
        return y if formed is None else formed(y)

    return jax.eval_shape(called, *arguments)
