"""The guard: where the Hermite update loses positiveness, take the Kalman mean and covariance instead.

The assumed density is negative where 1 + nu <= 0, and the published third-order filter diverges after a posterior
covariance that is not positive definite (Culver 1969, sections 6.4 and 8.2, ascribes it to large residuals). The
fallback is suboptimal 1 (5.67): m + K z, Omega, and the higher moments carried through the gain with kappa = 1.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, positive_definite
from nlbench.moments.moments import Components, dense
from nlbench.updates.measurement import Gain
from nlbench.updates.posterior import Posterior, through_gain

LEAST_DENSITY_RATIO = 0.25  # of 1 + nu


def fallback(prior: Components, gain: Gain, z: Tensor) -> Components:
    """The Kalman mean and covariance, with N (and its fourth-order analogue) formed with kappa = 1."""
    mean = prior.mean + einsum("ir,r->i", gain.K, z)
    fourth = None if prior.fourth is None else through_gain(gain.G, prior.fourth)
    return Components(mean, gain.omega, through_gain(gain.G, prior.third), fourth)


def guarded(posterior: Posterior, instead: Components) -> tuple[Components, Any]:
    """The posterior, or `instead` where 1 + nu < .25 or the covariance is not positive definite; and whether that was
    so (a prior that is not finite does not count)."""
    sound = (1 + posterior.nu >= LEAST_DENSITY_RATIO) & positive_definite(posterior.moments.cov)
    return either(sound, posterior.moments, instead), ~sound & jnp.isfinite(posterior.nu)


def integrable(prior: Components, gain: Gain) -> Any:
    """Whether the Gaussians of prior and linearised posterior have densities, over which an update can integrate."""
    return positive_definite(prior.cov) & positive_definite(gain.omega)


def either(sound: Any, moments: Components, instead: Components) -> Components:
    """The moments where they are sound, else those instead."""
    return jax.tree.map(lambda full, safe: jnp.where(sound, full, safe), dense(moments), dense(instead))
