"""The filter linear about a nominal motion (Schwartz 1967, (80); Kalman and Bucy), for continuous measurements.

  (1) x_n' = f(x_n)
  (2) d'   = F d + P H' W (y - h - H d),   estimate m = x_n + d
  (3) P'   = F P + P F' + G V G' - P H' W H P
F, H, f, h and G at the nominal x_n, W = Gamma^-1. (80) is printed without (1): there estimate and measurement are
deviations from the nominal. Carried: m, P, x_n. Fails when the truth leaves the nominal's neighbourhood.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nlbench.algebra import Tensor, einsum, expand
from nlbench.continuous.second_order import loss, slopes
from nlbench.continuous.sensing import Sensed, total
from nlbench.moments.equations import rates as autonomous_rates
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.algebra.scalars import Scalar
    from nlbench.systems.system import System


class AboutNominal(NamedTuple):
    """Moments of the estimate, and the nominal state (n,)."""

    moments: Components
    nominal: Tensor


def residual(sensed: Sensed, state: AboutNominal) -> Tensor:
    """y - h - H d, with h and H at the nominal: (m,)."""
    deviation = state.moments.mean - state.nominal
    expected = {(r,): einsum("i,i->", H, deviation)[()] for r, H in enumerate(sensed.H)}
    return sensed.z - Tensor(sensed.z.shape, ((0,),), expected)


def rates(system: System, t: Scalar, state: AboutNominal, sensed: Sensed | None) -> AboutNominal:
    """Derivatives of mean, covariance and nominal with y held; `sensed` None: nothing is measured."""
    P = state.moments.cov
    deviation = state.moments.mean - state.nominal
    autonomous = autonomous_rates(system, 1, t, Components(state.nominal, P))
    F = expand(system.drift_with_inputs, t, list(state.nominal), 1).first
    mean = autonomous.mean + einsum("ie,e->i", F, deviation)  # (1) + (2)
    if sensed is None:
        return AboutNominal(Components(mean, autonomous.cov), autonomous.mean)
    u = einsum("rs,s->r", sensed.W, residual(sensed, state))
    mean = mean + total([u[r] * c for r, c in enumerate(slopes(sensed, P))])
    return AboutNominal(Components(mean, autonomous.cov - loss(sensed, P)), autonomous.mean)  # (3)
