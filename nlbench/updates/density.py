"""The density of a residual under a Gaussian prior and a linearised measurement."""

from __future__ import annotations

import math
from typing import Any

from nlbench.algebra import Tensor, einsum, log_determinant


def gaussian_log_density(z: Tensor, W: Tensor, S_z: Tensor, entries: Any) -> Any:
    """Logarithm of the normal density N(z; 0, S_z), with W = S_z^-1; entries not taken have z = 0 and unit variance."""
    distance = einsum("r,r->", einsum("rs,s->r", W, z), z)[()]
    return -0.5 * (distance + log_determinant(S_z) + entries * math.log(2 * math.pi))
