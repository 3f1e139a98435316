"""The Kalman update of mean and covariance (Culver 1969, (5.66); information form (F.19))."""

from __future__ import annotations

from nlbench.algebra import Tensor, einsum
from nlbench.moments.moments import Components
from nlbench.updates.measurement import Gain
from nlbench.updates.posterior import Posterior


def kalman(prior: Components, gain: Gain, z: Tensor, clipped: Tensor) -> Posterior:
    """m+ = m + K z, P+ = Omega; no term is nonlinear in the residual."""
    return Posterior(Components(prior.mean + einsum("ir,r->i", gain.K, z), gain.omega), 0.0)
