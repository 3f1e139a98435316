"""Small systems built through the public interface, and golden cases turned into calls of it."""

from __future__ import annotations

import json
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import nlbench as nb

GOLDEN = {
    name: content
    for path in sorted((Path(__file__).parent / "golden").glob("updates*.json"))
    for name, content in json.loads(path.read_text()).items()
}


def golden(group):
    """The cases of a group as (id, inputs, outputs) with arrays."""
    for case in GOLDEN[group]:
        yield case["id"], _arrays(case["in"]), _arrays(case["out"])


def golden_ids(group):
    return [case["id"] for case in GOLDEN[group]]


def _arrays(named):
    return {name: np.array(value, dtype=float) for name, value in named.items()}


def assert_golden(actual, expected, name):
    """The file's own rule: |a - b| <= atol + rtol max|b|."""
    bound = GOLDEN["atol"] + GOLDEN["rtol"] * np.max(np.abs(expected))
    np.testing.assert_array_less(np.abs(np.asarray(actual) - expected), bound, err_msg=name)


def quadratic(mean, value, slope, half_hessian=None):
    """x -> value + slope e + half_hessian:ee with e = x - mean, in array form."""

    def function(t, x):
        e = x - mean
        result = value + slope @ e
        return result if half_hessian is None else result + jnp.einsum("iab,a,b->i", half_hessian, e, e)

    return function


def linear_measurement(mean, cov, h, r, third=None, fourth=None, **more):
    """A system at rest whose states are measured through a constant matrix."""
    n = len(mean)
    return nb.System(
        drift=more.pop("drift", lambda t, x: jnp.zeros(n)),
        observe=lambda t, x: jnp.asarray(h) @ x,
        measurement_cov=r,
        initial=nb.Moments(mean, cov, third, fourth),
        **more,
    )


def updated(name, system, y, **options):
    """One measurement at the system's initial moments: posterior moments as arrays, and the update's info."""
    f = nb.filters.build(name, system, **options)
    state, info = f.update(f.init(system.initial), 0.0, y)
    return f.moments(state), info


def dense(moments):
    """Mean and central moments 2, 3, 4 as NumPy arrays; a moment that is not carried stays None."""
    return tuple(
        None if a is None else np.asarray(a)
        for a in (moments.mean, moments.cov, moments.third, moments.fourth)
    )


def assert_vmap_equals_a_loop(function, states, t, y, rtol, atol):
    """function: (state, t, y) -> pytree, of the states one by one and of all together; y has a row for each."""
    stacked = jax.tree.map(lambda *parts: jnp.stack(parts), *states)
    together = jax.jit(jax.vmap(function, in_axes=(0, None, 0)))(stacked, t, y)
    step = jax.jit(function)
    for lane, state in enumerate(states):
        alone = step(state, t, y[lane])
        for mine, theirs in zip(jax.tree.leaves(together), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(mine[lane], theirs, rtol=rtol, atol=atol)
