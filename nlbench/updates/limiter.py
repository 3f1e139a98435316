"""The residual limiter (Culver 1969, (8.13)-(8.14))."""

from __future__ import annotations

import jax.numpy as jnp

from nlbench.algebra import Tensor


def limited(z: Tensor, S_z: Tensor, sigmas: float) -> Tensor:
    """Each residual clipped at +- `sigmas` times its predicted standard deviation sqrt((H P H' + R)_rr)."""

    def clip(r: tuple[int, ...]) -> object:
        bound = sigmas * jnp.sqrt(S_z[r[0], r[0]])
        return jnp.clip(z[r], -bound, bound)

    return Tensor.symmetric(z.shape[0], 1, clip)
