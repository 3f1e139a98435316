"""Claims: `shared` changes no result, and what several results share is formed once in the compiled program."""

from __future__ import annotations

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from nlbench.algebra import shared

X = np.linspace(0.5, 1.5, 64)


def powers(x, y):
    """Six results that share a polynomial of ten products."""
    p = x
    for k in range(10):
        p = p * (x + k)
    return {"a": [p * y, p + y, p - y], "b": (p * p, y, 2.0, p * x, -p)}


def calls(x, y):
    """Calls, a custom derivative, a loop, a division and a choice."""
    ratio = jax.nn.softplus(x) / jnp.where(y > 1.0, y, x)
    return [
        ratio,
        ratio + jax.lax.fori_loop(0, 3, lambda i, s: s * x + i, y),
        jnp.clip(ratio, 0.1, 0.9) * jnp.sin(ratio),
    ]


def over_lanes(function, **options):
    return jax.jit(
        lambda t, x, y: jax.vmap(lambda x, y: shared(function, t, x, y, **options), out_axes=0)(x, y)
    )


@pytest.mark.parametrize("reused", [False, True])
@pytest.mark.parametrize("function", [powers, calls])
def test_results_are_those_of_the_function(function, reused):
    expected = [function(x, y) for x, y in zip(X, X[::-1], strict=True)]
    expected = jax.tree.map(lambda *values: np.array(values, float), *expected)
    actual = over_lanes(function, reused=reused)(0.3, X, X[::-1])
    assert jax.tree.structure(actual) == jax.tree.structure(expected)
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-13), actual, expected)


def test_without_unknown_arguments_the_function_is_just_called():
    assert shared(lambda x: (x, x + 1.0), 0.0, 2.0) == (2.0, 3.0)


def products(compiled):
    return len(re.findall(r" multiply\(", compiled.as_text()))


def test_what_results_share_is_formed_once_in_the_compiled_program():
    once = products(over_lanes(powers).lower(0.3, X, X).compile())
    again = jax.jit(lambda x, y: jax.vmap(powers)(x, y)).lower(X, X).compile()
    assert once <= 13  # ten of the polynomial, three of its own results
    assert products(again) > 2 * once


def test_the_same_expression_is_the_same_program():
    first, second = (over_lanes(powers).lower(0.3, X, X).as_text() for _ in range(2))
    assert first == second
