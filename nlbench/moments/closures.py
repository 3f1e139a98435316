"""Higher central moments from lower ones: the quasi-moment (Hermite) and the cumulant closure.

A closure of order K sets the coefficients k_n of order n > K to zero. With k4 = mu4 - 3{PP} (Culver 1969,
(E.17)-(E.21), of which (E.20) and (E.21) corrected: the Hermite expansion is linear in the k_n, so the squares of S
belong to the cumulant closure alone):
  (1) mu4 = k4 + 3{P P}
  (2) mu5 = 10{P S}
  (3) mu6 = 15{P k4} + 15{P P P}            (+ 10{S S}, cumulant closure)
Gaussian closure: S = k4 = 0.
"""

from __future__ import annotations

from typing import Literal

from nlbench.algebra import Tensor, placements

Closure = Literal["quasi-moment", "cumulant"]


def gaussian_fourth(P: Tensor) -> Tensor:
    """3{P P}, the fourth moment of a Gaussian: (1) with k4 = 0."""
    return placements(3, "ij,kl->ijkl", P, P)


def fourth_coefficient(mu4: Tensor, P: Tensor) -> Tensor:
    """k4 of (1)."""
    return mu4 - gaussian_fourth(P)


def fifth_moment(P: Tensor, S: Tensor) -> Tensor:
    """(2), the same in both closures."""
    return placements(10, "ij,klm->ijklm", P, S)


def sixth_moment(P: Tensor, S: Tensor, k4: Tensor, closure: Closure = "quasi-moment") -> Tensor:
    """(3)."""
    mu6 = placements(15, "ij,klmn->ijklmn", P, k4) + placements(15, "ij,kl,mn->ijklmn", P, P, P)
    return mu6 + placements(10, "ijk,lmn->ijklmn", S, S) if closure == "cumulant" else mu6
