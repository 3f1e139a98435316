"""The moment equations between measurements, on unique nonzero components (Culver 1969, (4.64)-(4.67) without noise).

A_ief is half the curvature B_ief of an `Expansion`. A filter of second order has no third moments S.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.kernels.tensors import Expansion, Tensor, at, placements, total
from benchmarks.kernels.trace import Number


def mean_rate(f: Expansion, P: Tensor, i: int) -> Number:
    """m_i' = f_i + A_ief P_ef."""
    return f.value[i] + bent(f, i, lambda e, g: at(P, e, g))


def cov_rate(f: Expansion, P: Tensor, S: Tensor, i: int, j: int) -> Number:
    """P_ij' = 2{F_ie P_je + A_ief S_jef}."""
    return placements(
        (i, j),
        lambda i, j: (
            total(F * at(P, j, e) for (row, e), F in f.slope.items() if row == i)
            + bent(f, i, lambda e, g: at(S, j, e, g))
        ),
    )


def third_rate(f: Expansion, P: Tensor, S: Tensor, i: int, j: int, k: int) -> Number:
    """S_ijk' = 3{F_ie S_jke + 2 A_ief P_je P_kf}."""

    def term(i: int, j: int, k: int) -> Number:
        straight = total(F * at(S, j, k, e) for (row, e), F in f.slope.items() if row == i)
        last = sorted({g for row, _, g in f.curvature if row == i})
        return straight + total(along(f, P, i, j, g) * at(P, k, g) for g in last)

    return placements((i, j, k), term)


def bent(f: Expansion, i: int, X: Callable[[int, int], Number]) -> Number:
    """A_ief X_ef for a symmetric X."""
    return total(
        (0.5 * B if e == g else B) * X(e, g) for (row, e, g), B in f.curvature.items() if row == i and e <= g
    )


def along(f: Expansion, P: Tensor, i: int, j: int, g: int) -> Number:
    """2 A_ieg P_je."""
    return total(B * at(P, j, e) for (row, e, other), B in f.curvature.items() if (row, other) == (i, g))
