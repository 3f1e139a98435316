"""The equations of the Kalman filter linearised at the estimate, for noise that need not be additive.

With A, L the Jacobians of the transition f(k, x, w) in x and w, and C, D those of h(k, x, v), all at the estimate and
w = v = 0 (Athans 2001, (35)-(38), (48)-(52)):
  (1) m- = f(k, m, 0),  P- = A P A' + L Q L'
  (2) z = y - h(k, m, 0),  S = C P C' + D R D',  cov(x, y) = P C'
In continuous time, F the Jacobian of the drift:
  (3) dm = f,  dP = F P + P F' + G V G'
Exact for linear systems. Cost O(n^3). Fails when f or h bend within a standard deviation of the estimate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.discrete.correction import Gaussian, correct, predicted
from nlbench.discrete.expansion import drift, first
from nlbench.discrete.problem import spectrum

if TYPE_CHECKING:
    from nlbench.discrete.problem import Noisy, Observation
    from nlbench.filters.filter import UpdateInfo
    from nlbench.systems.system import System


def step(motion: Noisy, k: Any, prior: Gaussian) -> Gaussian:
    """(1)."""
    f = first(motion.function, k, prior.mean, len(motion.cov))
    return Gaussian(f.value, f.x @ prior.cov @ f.x.T + f.w @ motion.cov @ f.w.T)


def slope(system: System, t: Any, prior: Gaussian) -> Gaussian:
    """(3)."""
    f, F = drift(system, t, prior.mean)
    FP = F @ prior.cov
    return Gaussian(f, FP + FP.T + spectrum(system, t, prior.mean))


def update(seen: Observation, t: Any, prior: Gaussian, y: Any) -> tuple[Gaussian, UpdateInfo]:
    """(2)."""
    h = first(seen.function, t, prior.mean, len(seen.cov))
    C = prior.cov @ h.x.T
    S = h.x @ C + h.w @ seen.cov @ h.w.T
    return correct(prior, predicted(seen, y, seen.innovation(y, h.value), S, C), seen.limiter)
