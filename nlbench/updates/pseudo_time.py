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
How fast P changes, the root of the sum of squares of the eigenvalues of P D_ab, decides how long steps may be:
  (7) pace = sqrt(tr(P D P D)),   (8) fail where a step integrates more than .6 of it
For a Gaussian and linear h with the information i = tr(H P H'R^-1), P = (P0^-1 + s H'R^-1 H)^-1 changes by log(1 + i),
most of it at s < 1/i. In u, at no time faster than c (`docs/decisions/024-steps-of-the-integration-update.md`):
  (9) s = (exp(c u) - 1)/(exp(c) - 1),  c = log(1 + i),  10 c equal steps of u, at least 5
Cost O(n^5).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor, einsum, placements
from nlbench.moments.closures import Closure
from nlbench.moments.integrate import StagedRK4
from nlbench.moments.moments import Components, dense
from nlbench.updates.posterior import through_gain

MOST_CHANGE = 0.6  # of (8); for a Gaussian and linear h the covariance is then right to 1 %
STEPS_PER_NAT = 10  # of (9): it is right to 1e-5, in every direction
LEAST_STEPS = 5  # the source's
LEAST_INFORMATION = 1e-3  # below it steps of u are those of s
MOST_INFORMATION = 1e6  # above it rounding spoils the covariance


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


class Rates(NamedTuple):
    """Rates of the moments and of the log evidence; pace: how fast the covariance changes, relative to itself."""

    moments: Components
    evidence: Any
    pace: Any


def rates(moments: Components, D: Derivatives, closure: Closure = "quasi-moment") -> Rates:
    """(1)-(6): rates of the moments, of the order that they have, and of the log evidence; (7)."""
    P, S, k4 = moments.cov, moments.third, moments.fourth
    PD = einsum("ic,ca->ia", P, D.second)
    pace = jnp.sqrt(jnp.abs(jnp.asarray(einsum("ia,ai->", PD, PD)[()])))  # (7)
    mean = einsum("ia,a->i", P, D.first)  # (1)
    cov = through_gain(P, D.second)  # (2)
    if S is None:
        return Rates(Components(mean, cov), D.value, pace)
    mean = mean + 0.5 * einsum("ibc,bc->i", S, D.second)
    cov = cov + einsum("ija,a->ij", S, D.first)
    third = placements(3, "ia,jka->ijk", PD, S)  # (3)
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
        return Rates(Components(mean, cov, third), evidence, pace)
    cov = cov + 0.5 * einsum("ijab,ab->ij", k4, D.second, sym="ij")  # (5)
    third = third + einsum("ijka,a->ijk", k4, D.first, sym="ijk")
    fourth = placements(4, "ia,jkla->ijkl", PD, k4)
    fourth = fourth - placements(4, "ijk,l->ijkl", S, einsum("lab,ab->l", S, D.second), times=0.5)
    return Rates(Components(mean, cov, third, fourth), evidence, pace)


def integrated(
    rate: Callable[[Any, Components], Rates], start: Components, steps: int | None, information: Any = 0.0
) -> tuple[Components, Any]:
    """The moments at s = 1 from those at s = 0 by RK4, and the gain of the log evidence; NaN beyond (8).

    rate: (s, moments) -> rates. steps: so many of equal length; None: by (9), of the `information` that is let in.
    """
    if steps is None:
        c = jnp.log1p(jnp.maximum(information, LEAST_INFORMATION))  # (9)
        wanted = jnp.clip(
            jnp.ceil(STEPS_PER_NAT * c), LEAST_STEPS, STEPS_PER_NAT * math.log(MOST_INFORMATION)
        )
        count, bounded = wanted.astype(int), information <= MOST_INFORMATION
    else:
        c, count, bounded = None, steps, True
    h, solver = 1.0 / count, StagedRK4()

    def field(u: Any, state: tuple[Components, Any, Any]) -> tuple[Components, Any, Any]:
        s, speed = u, 1.0
        if c is not None:
            s, speed = jnp.expm1(c * u) / jnp.expm1(c), c * jnp.exp(c * u) / jnp.expm1(c)
        found = rate(s, state[0])
        scalars = (jnp.asarray(each, float) for each in (found.evidence, found.pace))
        return jax.tree.map(lambda each: speed * each, (dense(found.moments), *scalars))

    def step(number: Any, carry: tuple[Components, Any, Any]) -> tuple[Components, Any, Any]:
        moments, evidence, most = carry
        moments, evidence, change = solver.advance(field, number * h, h, (moments, evidence, jnp.zeros(())))
        return moments, evidence, jnp.maximum(most, change)

    found = jax.lax.fori_loop(0, count, step, (dense(start), jnp.zeros(()), jnp.zeros(())))
    sound = (found[2] <= MOST_CHANGE) & bounded  # (8)
    return jax.tree.map(lambda each: jnp.where(sound, each, jnp.nan), found[:2])
