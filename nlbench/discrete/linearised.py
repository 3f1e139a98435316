"""The equations of the Kalman filter linearised at the estimate, for noise that need not be additive.

With A, L the Jacobians of the transition f(k, x, w) in x and w, and C, D those of h(k, x, v), all at the estimate and
w = v = 0 (Athans 2001, (35)-(38), (48)-(52)):
  (1) m- = f(k, m, 0),  P- = A P A' + L Q L'
  (2) z = y - h(k, m, 0),  S = C P C' + D R D',  cov(x, y) = P C'
In continuous time, F the Jacobian of the drift, for `propagation`:
  (3) dm = f,  dP = F P + P F' + G V G'
Exact for linear systems. Cost O(n^3). Fails when f or h bend within a standard deviation of the estimate.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nlbench.discrete.correction import Spread, conditioned, factor, joint
from nlbench.discrete.expansion import drift, first
from nlbench.discrete.problem import noise_columns
from nlbench.discrete.propagation import Local
from nlbench.discrete.roots import square_root

if TYPE_CHECKING:
    from nlbench.discrete.problem import Noisy, Observation
    from nlbench.filters.filter import UpdateInfo
    from nlbench.systems.system import System


def step(motion: Noisy, k: Any, prior: Spread) -> Spread:
    """(1)."""
    f = first(motion.function, k, prior.mean, len(motion.cov))
    return Spread(f.value, factor(f.x @ prior.root, f.w @ square_root(motion.cov)))


def local(system: System, t: Any, mean: Any, columns: Any) -> Local:
    """(3)."""
    return Local(*drift(system, t, mean), noise_columns(system, t, mean))


def update(seen: Observation, t: Any, prior: Spread, y: Any) -> tuple[Spread, UpdateInfo]:
    """(2)."""
    h = first(seen.function, t, prior.mean, len(seen.cov))
    noise, z = h.w @ square_root(seen.cov), seen.innovation(y, h.value)
    return conditioned(prior, joint(seen, y, z, noise, h.x @ prior.root, prior.root), seen.limiter)
