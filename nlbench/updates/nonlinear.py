"""A measurement as the updates see it that look beyond its linearisation: the residual anywhere, the curvature.

Such an update is a function (prior, seen) -> Outcome.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, expand
from nlbench.algebra.scalars import Scalar
from nlbench.moments.moments import Components
from nlbench.updates.measurement import Gain, Measurement

if TYPE_CHECKING:
    from nlbench.systems.system import System


class Seen(NamedTuple):
    """A measurement at the prior mean m, with entries that are missing taken out, the others in turn (`Gain`): all of
    it is of T y instead of y.

    z: (m,), y - h(m), limited where a limiter is on. R: (m, m). gain: that of the linearised measurement.
    taken: the number of entries taken. slack: as of `Measurement`.
    curvature: () -> M (m, n, n), half the Hessians of h at m.
    residual: x (n,) -> (m,), y - h(x), shifted as the limiter shifted z, zero where missing.
    """

    z: Tensor
    R: Tensor
    gain: Gain
    taken: Any
    curvature: Callable[[], Tensor]
    residual: Callable[[Any], Any]
    slack: Tensor | None


class Outcome(NamedTuple):
    """Moments after the update; nu: 1 + nu is the predictive density over that of the Gaussian prior, as far as the
    update knows it; the logarithm of the predictive density of the entries taken."""

    moments: Components
    nu: Any
    log_likelihood: Any


def see(
    system: System,
    t: Scalar,
    prior: Components,
    y: Any,
    measurement: Measurement,
    gain: Gain,
    clipped: Tensor | None = None,
) -> Seen:
    """What `measurement` and `gain`, made of y (m,), leave out. clipped: the residual that the limiter left, if any."""
    y = jnp.asarray(y)
    there = ~jnp.isnan(y)
    filled = jnp.where(there, y, 0.0)

    def residual(x: Any) -> Any:
        h = system.observe(t, x)
        h = jnp.stack([jnp.asarray(part) for part in h]) if isinstance(h, (tuple, list)) else jnp.asarray(h)
        z = jnp.where(there, jnp.asarray(system.innovation(filled, h)), 0.0)
        z = z if clipped is None else z - (measurement.z - clipped).to_array()
        return z if len(z) == 1 else gain.T.to_array() @ z

    def curvature() -> Tensor:
        M = expand(system.observe, t, list(prior.mean), 2).second
        assert M is not None
        masked = {index: jnp.where(there[index[0]], entry, 0.0) for index, entry in M.entries.items()}
        M = Tensor(M.shape, M.symmetry, masked)
        return M if M.shape[0] == 1 else einsum("rs,sab->rab", gain.T, M)

    z = gain.turned(measurement.z if clipped is None else clipped)
    return Seen(z, gain.R, gain, measurement.taken, curvature, residual, measurement.slack)


def weighted(H: Tensor, W: Tensor, z: Tensor) -> Tensor:
    """H' W z."""
    return einsum("ra,r->a", H, einsum("rs,s->r", W, z))
