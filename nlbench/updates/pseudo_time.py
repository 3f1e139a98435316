"""How moments change as a polynomial l of degree four is added, little by little, to the logarithm of a density.

The density is N(m, P){1 + S:H3/6 + k4:H4/24}, b = x - m, and d/ds E g = cov(g, l). Taking g = exp(t b) and
E[(1 + S:H3/6 + k4:H4/24) g] = E_N[(1 + S:ddd/6 + k4:dddd/24) g] (d the gradient) gives the rate of the cumulants
in terms of the expected derivatives of l under N(m, P), D_k = E_N[d...d l]:
  (1) m'   = P_ia D_a + S_ibc D_bc/2 + P_ia S_bcd D_abcd/6
  (2) P'   = P_ia P_jb D_ab + S_ija D_a + 2{P_ia S_jbc D_abc}/2
  (3) S'   = P_ia P_jb P_kc D_abc + 3{P_ia S_jkc D_ac} + 3{P_ia P_jb S_kcd D_abcd}/2 - S_ijk S_abc D_abc/6
  (4) (log evidence)' = E l = D_0 + S_abc D_abc/6
and for l of degree two, with k4,
  (5) P' gains k4_ijab D_ab/2,  S' gains k4_ijka D_a,  k4' = 4{P_ia k4_jklc D_ac} - 4{S_ijk S_lab D_ab}/2.
These are the moment equations of Culver 1969, (5.83)-(5.85) and appendix G, with their quasi-moment closure. As
printed, (5.84)-(5.85) close mu6 with 10{S S} besides, and (5.85) lacks -3{P_ij m_k'}:
  (6) P' gains (4 S_ija S_bcd + 6 S_iab S_jcd) D_abcd/24,  S' gains (S_ijk S_abc + 3 3{S_ija S_kbc}) D_abc/6
Cost O(n^5).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, placements
from nlbench.moments.closures import Closure
from nlbench.moments.integrate import fixed_rk4
from nlbench.moments.moments import Components, dense
from nlbench.updates.posterior import through_gain


class Derivatives(NamedTuple):
    """Expected derivatives D_0 ... D_4 of l under N(m, P); None where they vanish."""

    value: Any
    first: Tensor
    second: Tensor
    third: Tensor | None = None
    fourth: Tensor | None = None


def expected(value: Any, first: Tensor, second: Tensor, D3: Tensor, D4: Tensor, P: Tensor) -> Derivatives:
    """Of l = value + first b + second bb + D3 bbb/6 + D4 bbbb/24."""
    D4P = einsum("abcd,cd->ab", D4, P, sym="ab")
    return Derivatives(
        value + einsum("ab,ab->", second + 0.125 * D4P, P)[()],
        first + 0.5 * einsum("abc,bc->a", D3, P),
        2.0 * second + 0.5 * D4P,
        D3,
        D4,
    )


def rates(moments: Components, D: Derivatives, closure: Closure = "quasi-moment") -> tuple[Components, Any]:
    """(1)-(6): rates of the moments, of the order that they have, and of the log evidence."""
    P, S, k4 = moments.cov, moments.third, moments.fourth
    mean = einsum("ia,a->i", P, D.first)  # (1)
    cov = through_gain(P, D.second)  # (2)
    if S is None:
        return Components(mean, cov), D.value
    mean = mean + 0.5 * einsum("ibc,bc->i", S, D.second)
    cov = cov + einsum("ija,a->ij", S, D.first)
    third = placements(3, "ia,jka->ijk", einsum("ic,ca->ia", P, D.second), S)  # (3)
    evidence = D.value
    if D.third is not None:
        SD3 = einsum("abc,abc->", S, D.third)[()]
        SD = einsum("jbc,abc->ja", S, D.third)
        cov = cov + placements(2, "ia,ja->ij", P, SD, times=0.5)
        third = third + through_gain(P, D.third) - (SD3 / 6) * S
        evidence = evidence + SD3 / 6  # (4)
        if closure == "cumulant":
            third = third + (SD3 / 6) * S + placements(3, "ija,ka->ijk", S, SD, times=0.5)  # (6)
    if D.fourth is not None:
        SD4 = einsum("bcd,abcd->a", S, D.fourth)
        SD4_2 = einsum("kcd,abcd->kab", S, D.fourth, sym="ab")
        mean = mean + (1 / 6) * einsum("ia,a->i", P, SD4)
        PPSD = einsum("jb,kib->kij", P, einsum("ia,kab->kib", P, SD4_2), sym="ij")
        third = third + placements(3, "kij->ijk", PPSD, times=0.5)
        if closure == "cumulant":
            cov = cov + (1 / 6) * einsum("ija,a->ij", S, SD4)  # (6)
            cov = cov + 0.25 * einsum("iab,jab->ij", S, SD4_2, sym="ij")
    if k4 is None:
        return Components(mean, cov, third), evidence
    cov = cov + 0.5 * einsum("ijab,ab->ij", k4, D.second, sym="ij")  # (5)
    third = third + einsum("ijka,a->ijk", k4, D.first, sym="ijk")
    fourth = placements(4, "ia,jkla->ijkl", einsum("ic,ca->ia", P, D.second), k4)
    fourth = fourth - placements(4, "ijk,l->ijkl", S, einsum("lab,ab->l", S, D.second), times=0.5)
    return Components(mean, cov, third, fourth), evidence


def integrated(
    rate: Callable[[Any, Components], tuple[Components, Any]], start: Components, steps: int
) -> tuple[Components, Any]:
    """The moments at s = 1 from those at s = 0 by `steps` steps of RK4, and the gain of the log evidence.

    rate: (s, moments) -> rates of the moments and of the log evidence.
    """

    def field(s: Any, state: tuple[Components, Any]) -> tuple[Components, Any]:
        moments, evidence = rate(s, state[0])
        return dense(moments), jnp.asarray(evidence, float)

    return fixed_rk4().integrate(field, 0.0, 1.0 / steps, steps, (dense(start), jnp.zeros(())))
