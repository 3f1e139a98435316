"""Filters of continuous measurements with mean and covariance (Schwartz 1967, (81)-(87); Henriksen 1980, (35)-(37)).

System dx = f dt + G dw, y = dz/dt = h + noise of spectral density Gamma, W = Gamma^-1. About the mean, h = h + H_r e +
M_r:ee (so h'' of the sources is 2 M); summed over the measurements r,
  (1) m_i'  = autonomous + u_r P_ip H_rp,                           u = W nu
  (2) P_ij' = autonomous - (P H_r)_i W_rs (P H_s)_j + C_ij
  residual  plain    nu_r = y_r - h_r
            curved   nu_r = y_r - h_r - M_r:P
  forcing   none     C_ij = 0
            gaussian   C_ij = 2 u_r P_ip M_rpq P_qj    the fourth moments of a Gaussian density
            truncated  C_ij = -u_r P_ij M_r:P          fourth moments left out where squares of P are not (erroneous)
The autonomous rates are those of `moments.equations` of order 1 (f at the mean) or 2 (f and G G' curved).
A filter is a choice of the three, the table `FILTERS`. As vectors, 3, 4, 7 and 8 are the scalar filters' equations read
with matrices. Fails when steps are so long that P becomes negative; `truncated` forcing can make it so by itself.

Where the source printed something else (scalar filters 3 to 7, misprints), with w = 1/Gamma and h'' = 2 M:
  (82), (83)  h'' for h' in the mean:  m' = f + f'' p/2 + w p h'' nu
  (84), (85)  Gamma for w:             p' has -Gamma p^2 h'^2
  (86)        p^2 lost:                C = -w h'' nu/2
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from nlbench.algebra import Tensor, einsum
from nlbench.continuous.sensing import Sensed, curved_residual, total, weighted
from nlbench.moments.equations import rates as autonomous_rates
from nlbench.moments.moments import Components

if TYPE_CHECKING:
    from nlbench.algebra.scalars import Scalar
    from nlbench.systems.system import System

Residual = Callable[[Sensed, Tensor], Tensor]
Forcing = Callable[[Sensed, Tensor, Tensor], Tensor]


def plain(sensed: Sensed, P: Tensor) -> Tensor:
    """y - h."""
    return sensed.z


def no_forcing(sensed: Sensed, P: Tensor, u: Tensor) -> Tensor:
    """C = 0."""
    return Tensor(P.shape, P.symmetry, {})


def gaussian(sensed: Sensed, P: Tensor, u: Tensor) -> Tensor:
    """C_ij = 2 u_r P_ip M_rpq P_qj."""
    M = total([u[r] * M for r, M in enumerate(sensed.M)])
    return einsum("iq,qj->ij", einsum("ip,pq->iq", P, M), P, sym="ij") * 2.0


def truncated(sensed: Sensed, P: Tensor, u: Tensor) -> Tensor:
    """C_ij = -u_r P_ij M_r:P."""
    bias = sum(u[r] * einsum("pq,pq->", M, P)[()] for r, M in enumerate(sensed.M))
    return -bias * P


def slopes(sensed: Sensed, P: Tensor) -> list[Tensor]:
    """P H_r, for each measurement."""
    return [einsum("ip,p->i", P, H) for H in sensed.H]


def loss(sensed: Sensed, P: Tensor) -> Tensor:
    """(P H_r)_i W_rs (P H_s)_j, what the measurements take off the covariance; its parts need not be symmetric."""
    taken = slopes(sensed, P)
    pairs = zip(taken, weighted(sensed.W, taken), strict=True)
    return total([einsum("i,j->ij", c, w, sym="ij") for c, w in pairs])


def printed_gain(sensed: Sensed, P: Tensor) -> list[Tensor]:
    """p h'', of the misprinted (82) and (83)."""
    return [Tensor((1,), ((0,),), {(0,): 2.0 * P[0, 0] * sensed.M[0][0, 0]})]


def printed_loss(sensed: Sensed, P: Tensor) -> Tensor:
    """Gamma p^2 h'^2, of the misprinted (84) and (85)."""
    (taken,) = slopes(sensed, P)
    return sensed.gamma[0, 0] * einsum("i,j->ij", taken, taken)


def printed_forcing(sensed: Sensed, P: Tensor, u: Tensor) -> Tensor:
    """-w h'' nu/2, of the misprinted (86)."""
    return -u[0] * sensed.M[0]


class SecondOrder(NamedTuple):
    """One filter: order of its autonomous rates, and its parts."""

    order: int
    residual: Residual
    forcing: Forcing
    gain: Callable[[Sensed, Tensor], list[Tensor]] = slopes
    loss: Callable[[Sensed, Tensor], Tensor] = loss


FILTERS = {
    "gaussian": SecondOrder(2, curved_residual, gaussian),  # (81)
    "truncated": SecondOrder(2, curved_residual, truncated),  # (82), (56)
    "modified": SecondOrder(2, curved_residual, no_forcing),  # (83), Henriksen (35)-(37)
    "maximum-principle": SecondOrder(1, plain, gaussian),  # (84)
    "linearised": SecondOrder(1, plain, no_forcing),  # (85), Culver (4.71)-(4.72)
    "discrete-truncated": SecondOrder(2, plain, truncated),  # (86)
    "discrete-gaussian": SecondOrder(2, plain, gaussian),  # (87)
}
MISPRINTED = {
    "schwartz-3": FILTERS["truncated"]._replace(gain=printed_gain),
    "schwartz-4": FILTERS["modified"]._replace(gain=printed_gain),
    "schwartz-5": FILTERS["maximum-principle"]._replace(loss=printed_loss),
    "schwartz-6": FILTERS["linearised"]._replace(loss=printed_loss),
    "schwartz-7": FILTERS["discrete-truncated"]._replace(forcing=printed_forcing),
}


def rates(
    system: System, parts: SecondOrder, t: Scalar, moments: Components, sensed: Sensed | None
) -> Components:
    """Derivatives of mean and covariance with y held; `sensed` None: nothing is measured."""
    found = autonomous_rates(system, parts.order, t, moments)
    if sensed is None:
        return found
    P = moments.cov
    u = einsum("rs,s->r", sensed.W, parts.residual(sensed, P))
    gained = total([u[r] * c for r, c in enumerate(parts.gain(sensed, P))])
    return Components(
        found.mean + gained,  # (1)
        found.cov - parts.loss(sensed, P) + parts.forcing(sensed, P, u),  # (2)
    )
