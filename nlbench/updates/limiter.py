"""The residual limiter (Culver 1969, (8.13)-(8.14))."""

from __future__ import annotations

import jax.numpy as jnp

from nlbench.algebra import Tensor


def limited(z: Tensor, S_z: Tensor, sigmas: float) -> Tensor:
    """Each residual clipped at +- `sigmas` times its predicted standard deviation sqrt((H P H' + R)_rr).

    A predicted variance that is negative, as the third-order filter can have for a while, leaves nothing of it.
    """

    def clip(r: tuple[int, ...]) -> object:
        bound = sigmas * jnp.sqrt(jnp.maximum(S_z[r[0], r[0]], 0.0))
        return jnp.clip(z[r], -bound, bound)

    return Tensor.symmetric(z.shape[0], 1, clip)
