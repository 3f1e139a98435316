"""Claim: compilations and operations of a workload are those that it has."""

from __future__ import annotations

import jax.numpy as jnp

from nlbench.perf import workloads


def test_a_program_is_compiled_once_and_jax_says_so():
    for scale in (3.25, 4.75):
        _, counts = workloads.compiled(lambda x, scale=scale: jnp.sin(scale * x), (jnp.ones(5),))
        assert counts["compilations"] == 1
        assert counts["instructions"] >= 2


def test_twice_the_multiplications_are_twice_the_operations():
    x = jnp.ones((64, 64))
    once, twice = (
        workloads.compiled(work, (x,))[1]["flops"]
        for work in (lambda x: x @ x, lambda x: (x @ x) @ (x + 1.0))
    )
    assert 1.9 < twice / once < 2.1
