"""The density of a residual under a Gaussian prior and a linearised measurement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, log_determinant

if TYPE_CHECKING:
    from nlbench.updates.measurement import Gain


def gaussian_log_density(z: Tensor, gain: Gain, taken: Any, slack: Tensor | None = None) -> Any:
    """Return log N(z; 0, S) of the entries taken. z: (m,), in turn; entries not taken have z = 0 and unit variance.

    An entry that is certain, given those before it, has no density: it counts as probable, log 1 = 0, where it is what
    was predicted, to within `slack` (m,), and as impossible, -inf, elsewhere.
    """
    distance = einsum("r,r->", einsum("rs,s->r", gain.W, z), z)[()]
    if gain.certain is None or slack is None:
        return -0.5 * (distance + log_determinant(gain.variance) + taken * math.log(2 * math.pi))
    certain = jnp.stack(gain.certain)
    level = distance + log_determinant(gain.variance) + (taken - certain.sum()) * math.log(2 * math.pi)
    off = certain & (jnp.abs(z.to_array()) > slack.to_array())
    return jnp.where(off.any(), -jnp.inf, -0.5 * level)
