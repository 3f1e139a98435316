"""A measurement as the updates see it: linearised at the prior mean, with its gain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum, expand, identity, inverse
from nlbench.algebra.scalars import Scalar

if TYPE_CHECKING:
    from nlbench.moments.moments import Components
    from nlbench.systems.system import System


class Measurement(NamedTuple):
    """y = h + H e + v at the prior mean: residual z (m,), H (m, n), covariance R (m, m), number of entries taken."""

    z: Tensor
    H: Tensor
    R: Tensor
    taken: Any


class Gain(NamedTuple):
    """What every update needs, in measurement space; W is the inverse of the innovation covariance.

    (1) S_z = H P H' + R,  W = S_z^-1,  K = P H' W,  G = I - K H,  Omega = G P
    """

    H: Tensor
    S_z: Tensor
    W: Tensor
    K: Tensor
    G: Tensor
    omega: Tensor


def linearise(system: System, t: Scalar, prior: Components, y: Any, missing: bool) -> Measurement:
    """The measurement `y` (m,) linearised at the prior mean.

    missing: whether entries of y may be NaN; such an entry is taken out by a zero row of H, a zero residual and a unit
        variance, which leaves the others exactly as they are.
    """
    m = system.measurements
    h = expand(system.observe, t, list(prior.mean), 1)
    y = jnp.asarray(y)
    predicted = h.value.to_array()
    z = Tensor.from_array(jnp.asarray(system.innovation(y, predicted)))
    R = Tensor.from_array(np.asarray(system.measurement_cov, float), ((0, 1),))
    if not missing:
        return Measurement(z, h.first, R, m)
    there = [~jnp.isnan(y[r]) for r in range(m)]
    H = Tensor(
        h.first.shape,
        h.first.symmetry,
        {(r, i): jnp.where(there[r], entry, 0.0) for (r, i), entry in h.first.entries.items()},
    )
    z = Tensor.symmetric(m, 1, lambda r: jnp.where(there[r[0]], z[r], 0.0))
    R = Tensor.symmetric(
        m, 2, lambda rs: jnp.where(there[rs[0]] & there[rs[1]], R[rs], 1.0 if rs[0] == rs[1] else 0.0)
    )
    return Measurement(z, H, R, sum(entry.astype(int) for entry in there))


def gain(P: Tensor, measurement: Measurement) -> Gain:
    """(1)."""
    H = measurement.H
    PH = einsum("ia,ra->ir", P, H)
    S_z = einsum("ra,as->rs", H, PH, sym="rs") + measurement.R
    W = inverse(S_z)
    K = einsum("is,sr->ir", PH, W)
    G = identity(P.shape[0]) - einsum("ir,ra->ia", K, H)
    return Gain(H, S_z, W, K, G, einsum("ia,aj->ij", G, P, sym="ij"))
