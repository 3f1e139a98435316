"""Claim: Taylor coefficients equal those of jax.jacfwd and jax.hessian, and their zeros are structural."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from nlbench.algebra import expand
from tests.oracle import rng

MATRIX = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -2.0], [0.0, 0.0, 0.0]])
QUADRATIC = rng(3).normal(size=(2, 3, 3))


def oscillator(t, x):
    return jnp.stack([x[1], -x[0] - 2 * x[1] * x[2], jnp.zeros_like(x[2])])


def orbit(t, x):
    r, v = x[:2], x[2:]
    return jnp.concatenate([v, -r / jnp.sum(r**2) ** 1.5])


def unpacked(t, x):
    a, b, c = x
    return jnp.array([b, -a - 2 * b * c, 0.0])


def updated_in_place(t, x):
    return jnp.zeros(3).at[0].set(x[1]).at[1].add(-x[0] - 2 * x[1] * x[2])


# name: (function, states, nonzero entries of the Jacobian, nonzero unique entries of the Hessian)
OSCILLATOR_FIRST, OSCILLATOR_SECOND = {(0, 1), (1, 0), (1, 1), (1, 2)}, {(1, 1, 2)}
ORBIT_SECOND = {(i, j, k) for i in (2, 3) for j, k in ((0, 0), (0, 1), (1, 1))}
SPARSE = {
    "stack": (oscillator, 3, OSCILLATOR_FIRST, OSCILLATOR_SECOND),
    "unpack and array": (unpacked, 3, OSCILLATOR_FIRST, OSCILLATOR_SECOND),
    "tuple of scalars": (
        lambda t, x: (x[1], -x[0] - 2 * x[1] * x[2], 0.0),
        3,
        OSCILLATOR_FIRST,
        OSCILLATOR_SECOND,
    ),
    "slice, norm and concatenate": (
        orbit,
        4,
        {(0, 2), (1, 3), (2, 0), (2, 1), (3, 0), (3, 1)},
        ORBIT_SECOND,
    ),
    "matmul by a constant": (lambda t, x: jnp.asarray(MATRIX) @ x, 3, {(0, 1), (1, 2)}, set()),
    "where": (
        lambda t, x: jnp.where(jnp.array([True, False, True]), x * x[0], 3.0),
        3,
        {(0, 0), (2, 0), (2, 2)},
        {(0, 0, 0), (2, 0, 2)},
    ),
    "where on the state": (
        lambda t, x: jnp.stack([jnp.where(x[0] > 0, x[0] ** 2, x[1]), x[1]]),
        2,
        {(0, 0), (0, 1), (1, 1)},
        {(0, 0, 0)},
    ),
    "reversed, transposed, reshaped": (
        lambda t, x: (x.reshape(2, 2).T[::-1] * jnp.array([[1.0, 0.0], [2.0, 0.0]])).ravel(),
        4,
        {(0, 1), (2, 0)},
        set(),
    ),
    "fancy index": (lambda t, x: x[jnp.array([2, 0])] ** 2, 3, {(0, 2), (1, 0)}, {(0, 2, 2), (1, 0, 0)}),
    "split and hstack": (
        lambda t, x: jnp.hstack([part**3 for part in jnp.split(x, 2)[::-1]]),
        2,
        {(0, 1), (1, 0)},
        {(0, 1, 1), (1, 0, 0)},
    ),
    "einsum": (
        lambda t, x: jnp.einsum("ij,j->i", jnp.asarray(MATRIX), x),
        3,
        {(0, 1), (1, 2)},
        set(),
    ),
    "jitted": (jax.jit(oscillator), 3, OSCILLATOR_FIRST, OSCILLATOR_SECOND),
    "vmap over elements": (
        lambda t, x: jax.vmap(lambda a: a**2)(x),
        2,
        {(0, 0), (1, 1)},
        {(0, 0, 0), (1, 1, 1)},
    ),
}
DENSE = {
    "updated in place": (updated_in_place, 3),
    "transcendental": (
        lambda t, x: jnp.stack([jnp.arctan(x[0]) * jnp.exp(-x[1]), jnp.sin(t) * jnp.log1p(x[1] ** 2) / x[0]]),
        2,
    ),
    "angle": (lambda t, x: jnp.atleast_1d(jnp.arctan2(1.2 - x[1], 0.7 - x[0])), 2),
    "powers": (lambda t, x: jnp.stack([x[0] ** 2.5, x[1] ** -3, jnp.sqrt(x[0]) / 3, x[1] ** 4 / 4]), 2),
    "quadratic form": (lambda t, x: jnp.einsum("iab,a,b->i", jnp.asarray(QUADRATIC), x, x), 3),
    "loop": (lambda t, x: lax.fori_loop(0, 3, lambda i, v: v + 0.1 * jnp.sin(v) * x[::-1], x), 2),
    "scan": (lambda t, x: lax.scan(lambda c, e: (c * e + x, None), x, jnp.arange(3.0))[0], 2),
    "branch": (lambda t, x: lax.cond(x[0] > 0, lambda v: v**3, jnp.sin, x), 2),
    "solve": (lambda t, x: jnp.linalg.solve(jnp.eye(2) * (2 + x[0] ** 2) + 0.1, x), 2),
    "cumulative": (lambda t, x: jnp.cumsum(x**2), 3),
    "maximum and clip": (lambda t, x: jnp.maximum(x, 0.1) ** 2 + jnp.clip(x, -0.5, 0.5) * x[0], 2),
    "interpolation": (lambda t, x: jnp.interp(x, jnp.array([0.0, 1, 2]), jnp.array([0.0, 1, 4])) * x, 2),
    "logistic": (lambda t, x: jax.nn.sigmoid(x) + jax.nn.softplus(x[::-1]), 2),
    "checkpoint": (jax.checkpoint(lambda t, x: jnp.sin(x) * x[0]), 2),
}
POINTS = {n: 0.4 + 0.3 * rng(n).uniform(size=n) for n in (2, 3, 4)}
ALL = {name: row[:2] for name, row in (SPARSE | DENSE).items()}


def unwrapped(function):
    return lambda t, x: jnp.stack([jnp.asarray(y) for y in function(t, x)])


@pytest.mark.parametrize(
    ("name", "compiled"),
    [(name, True) for name in ALL] + [(name, False) for name in ("stack", "jitted", "loop", "solve")],
)
def test_derivatives_equal_jacfwd_and_hessian(name, compiled):
    function, n = ALL[name]
    plain = unwrapped(function)

    def coefficients(t, x):
        taylor = expand(function, t, list(x), order=2)
        return [part.to_array() for part in taylor]

    x = jnp.asarray(POINTS[n])
    oracle = jax.jit(lambda t, x: (plain(t, x), jax.jacfwd(plain, 1)(t, x), jax.hessian(plain, 1)(t, x) / 2))
    actual = (jax.jit(coefficients) if compiled else coefficients)(0.3, x)
    for mine, theirs in zip(actual, oracle(0.3, x), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("name", SPARSE)
def test_structural_zeros_are_found(name):
    function, n, first, second = SPARSE[name]
    taylor = expand(function, 0.0, list(jnp.asarray(POINTS[n])), order=2)
    assert set(taylor.first.entries) == first
    assert set(taylor.second.entries) == second


def test_entries_that_do_not_depend_on_the_state_are_python_floats():
    taylor = expand(oscillator, 0.0, list(jnp.asarray(POINTS[3])), order=2)
    known = {index: entry for index, entry in taylor.first.entries.items() if isinstance(entry, float)}
    assert known == {(0, 1): 1.0, (1, 0): -1.0}
    assert taylor.second.entries == {(1, 1, 2): -1.0}
    assert type(taylor.second.entries[1, 1, 2]) is float


def test_a_known_time_is_folded_and_an_unknown_one_is_not():
    """Coefficients at a known time are constants; at a traced time they stay arrays and agree."""

    def function(t, x):
        return jnp.stack([jnp.cos(t) * x[1], t * x[0]])

    point = list(jnp.asarray(POINTS[2]))
    known = expand(function, 0.5, point, order=1).first
    assert all(type(entry) is float for entry in known.entries.values())
    traced = jax.jit(lambda t: expand(function, t, point, order=1).first.to_array())(0.5)
    np.testing.assert_allclose(traced, known.to_array(), rtol=1e-15)


def test_integer_and_float_arithmetic_on_a_known_time_are_kept_apart():
    """3 // 2 and 3 / 2 look alike once the numbers are Python's."""

    def function(t, x):
        return jnp.stack(
            [x[0] * lax.div(t.astype(int), 2), x[0] * lax.div(t, 2.0), x[0] * lax.rem(t.astype(int), 2)]
        )

    values = expand(function, 3.0, [jnp.asarray(1.0)], order=0).value
    np.testing.assert_array_equal(values.to_array(), [1.0, 1.5, 1.0])


def test_a_symmetric_function_gives_symmetric_coefficients():
    def function(t, x):
        g = jnp.stack([x[0], 2.0 * x[1]])
        return jnp.outer(g, g)

    x = jnp.asarray(POINTS[2])
    taylor = expand(function, 0.0, list(x), order=2, symmetry=((0, 1),))
    assert set(taylor.value.entries) == {(0, 0), (0, 1), (1, 1)}
    np.testing.assert_allclose(taylor.second.to_array(), jax.hessian(function, 1)(0.0, x) / 2, atol=1e-13)


def test_order_tells_how_far_the_expansion_goes():
    point = list(jnp.asarray(POINTS[3]))
    assert expand(oscillator, 0.0, point, order=0)[1:] == (None, None)
    assert expand(oscillator, 0.0, point, order=1).second is None


def test_float32_points_give_float32_coefficients():
    taylor = expand(orbit, 0.0, list(jnp.asarray(POINTS[4], jnp.float32)), order=2)
    assert {entry.dtype for entry in taylor.second.entries.values()} == {jnp.dtype("float32")}
