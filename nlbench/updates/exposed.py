"""The pseudo-time rates of the updates that integrate, between full arrays, for checks of one's own."""

from __future__ import annotations

from typing import Any, Literal

import jax.numpy as jnp

from nlbench.algebra import Tensor, inverse
from nlbench.moments.closures import Closure
from nlbench.moments.equations import fourth_moment_rate
from nlbench.moments.moments import Components, Moments, to_components, to_full
from nlbench.updates import tempering, two_step

Equations = Literal["corrected", "printed"]


def tempering_rates(
    moments: Moments,
    prior_mean: Any,
    z: Any,
    H: Any,
    R: Any,
    M: Any = None,
    equations: Equations = "corrected",
) -> Moments:
    """Rates in pseudo-time of `integration-update`: derivatives of the moments as the likelihood is let in.

    moments: the present ones, of order 4 if `fourth` is given (then M must be None), else 3. prior_mean: (n,), where
    the measurement was expanded. z: (m,), y - h there. H: (m, n). R: (m, m). M: (m, n, n), half the Hessians, or None.
    """
    if M is not None and moments.fourth is not None:
        raise ValueError("tempering_rates: a fourth moment goes with a linear measurement only (M=None)")
    state, H, z, noise, mean = _components(moments, H, z, R, prior_mean)
    return _full(state, tempering.rates(state, mean, z, H, _curvature(M), noise, equations).moments)


def two_step_rates(
    s: Any,
    moments: Moments,
    prior_mean: Any,
    z: Any,
    H: Any,
    M: Any,
    R: Any,
    equations: Equations = "corrected",
    closure: Closure | None = None,
) -> Moments:
    """Rates in pseudo-time of `two-step-2` (moments without third) and `two-step-3`, at s in [0, 1].

    closure: "quasi-moment" or "cumulant"; None means that of the equations. The rest as for `tempering_rates`.
    """
    state, H, z, noise, mean = _components(moments, H, z, R, prior_mean)
    M = _curvature(M)
    return _full(state, two_step.rates(s, state, mean, z, H, M, noise, equations, closure).moments)


def _components(
    moments: Moments, H: Any, z: Any, R: Any, mean: Any
) -> tuple[Components, Tensor, Tensor, Tensor, Tensor]:
    order = 4 if moments.fourth is not None else 2 if moments.third is None else 3
    H, z, R, mean = (jnp.asarray(array, float) for array in (H, z, R, mean))
    noise = inverse(Tensor.from_array(R, ((0, 1),)))
    return (
        to_components(moments, order),
        Tensor.from_array(H),
        Tensor.from_array(z),
        noise,
        Tensor.from_array(mean),
    )


def _curvature(M: Any) -> Tensor | None:
    return None if M is None else Tensor.from_array(jnp.asarray(M, float), ((0,), (1, 2)))


def _full(moments: Components, rates: Components) -> Moments:
    """As arrays; that of the fourth is the rate of the moment, not of the coefficient."""
    full = to_full(rates._replace(fourth=None))
    return (
        full if rates.fourth is None else full._replace(fourth=fourth_moment_rate(moments, rates).to_array())
    )
