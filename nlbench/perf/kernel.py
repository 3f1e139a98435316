"""The frozen reference kernel: what all times are divided by. Never change it; baselines hold its hash.

RK4 of a damped, coupled oscillator with a cubic force, in blocks of 64 lanes of float64: additions and products of
vectors under XLA, as in a filter, and a division a stage.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nlbench.results import checksum

VERSION = 1
LANES = 64
STEPS = 2_000
STEP = 0.01


def reference() -> Any:
    """The compiled kernel, as a function without arguments that waits for its end."""
    import jax
    import jax.numpy as jnp

    def rate(x: Any) -> Any:
        force = -x[0] - 0.3 * x[0] * x[0] * x[0] - 0.1 * x[1] + 0.5 * x[2]
        return (x[1], force, x[3], (0.5 * x[0] - x[2]) / (1.0 + 0.2 * x[2] * x[2]) - 0.1 * x[3])

    def moved(x: Any, h: float, k: Any) -> Any:
        return tuple(a + h * b for a, b in zip(x, k, strict=True))

    def step(_: Any, x: Any) -> Any:
        a = rate(x)
        b = rate(moved(x, STEP / 2, a))
        c = rate(moved(x, STEP / 2, b))
        d = rate(moved(x, STEP, c))
        total = tuple(p + 2 * q + 2 * r + s for p, q, r, s in zip(a, b, c, d, strict=True))
        return moved(x, STEP / 6, total)

    start = jnp.linspace(0.1, 1.0, LANES, dtype=jnp.float64)
    x = (start, 0 * start, 1 - start, 0 * start)
    program = jax.jit(lambda x: jax.lax.fori_loop(0, STEPS, step, x)).lower(x).compile()
    return lambda: jax.block_until_ready(program(x))


def identity() -> str:
    """Version and hash of this file."""
    return f"{VERSION}:{checksum.of_bytes(Path(__file__).read_bytes())[:16]}"
