"""Kalman filters, one for each value of an unknown constant, as one posterior: what banks in both kinds of time share.

Each filter makes a Kalman update, its weight multiplied by the density it had foretold:
  (1) log w_p += log N(y; h_p, S_p)
The posterior of (x, z), z the constant, is a mixture; with d_p = (m_p, z_p) - m its moments are exact sums:
  (2) m = sum w_p (m_p, z_p),  cov = sum w_p (d d + P),  third = sum w_p (d d d + 3{P d}),
      fourth = sum w_p (d d d d + 6{P d d} + 3{P P})
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.algebra import Tensor
from nlbench.filters.filter import UpdateInfo
from nlbench.moments.closures import fourth_coefficient
from nlbench.moments.moments import Components, dense
from nlbench.references.sums import total as sum_over_nodes
from nlbench.updates.density import gaussian_log_density
from nlbench.updates.kalman import kalman
from nlbench.updates.measurement import gain

if TYPE_CHECKING:
    from nlbench.systems.exact import KalmanBank, ParameterBank
    from nlbench.updates.measurement import Measurement


class State(NamedTuple):
    """Logarithm of the nodes' weights (p,), up to a constant; mean and covariance of each filter, components (p,)."""

    log_weights: Any
    each: Components


def start(bank: KalmanBank | ParameterBank) -> State:
    """The prior."""
    mean, cov = (
        Tensor.from_array(jnp.asarray(part, float), symmetry)
        for part, symmetry in ((bank.mean, ((0,),)), (bank.cov, ((0, 1),)))
    )
    everywhere = lambda leaf: jnp.full(jnp.shape(bank.nodes), leaf)  # noqa: E731
    return State(jnp.log(jnp.asarray(bank.weights)), jax.tree.map(everywhere, Components(mean, cov)))


def update(
    measure: Callable[[Any, Components], Measurement], nodes: Any, state: State
) -> tuple[State, UpdateInfo]:
    """After the measurement that each node's filter sees, measure(node, prior)."""
    each = jax.vmap(lambda node, prior: _updated(measure(node, prior), prior))(nodes, state.each)
    posterior = State(state.log_weights + each.log_density, each.moments)  # (1)
    return posterior, _info(state, posterior, each)


class Updated(NamedTuple):
    """One node's filter after a measurement; the density (1) in logarithms, residual and its covariance."""

    moments: Components
    log_density: Any
    z: Tensor
    S_z: Tensor


def _updated(measurement: Measurement, prior: Components) -> Updated:
    """The Kalman update of one node's filter."""
    gained = gain(prior.cov, measurement)
    z = gained.turned(measurement.z)
    density = gaussian_log_density(z, gained, measurement.taken, measurement.slack)
    return Updated(
        dense(kalman(prior, gained, z, z).moments), density, measurement.z.dense(), gained.S.dense()
    )


def _normalised(log_weights: Any) -> Any:
    weights = jnp.exp(log_weights - jnp.max(log_weights))
    return weights / sum_over_nodes(weights)


def moments(nodes: Any, state: State) -> Components:
    """(2), the fourth as a Hermite coefficient."""
    w, each = _normalised(state.log_weights), state.each
    n = each.mean.shape[0] + 1
    points = [*each.mean, nodes]
    mean = [sum_over_nodes(w * x) for x in points]
    d = [x - m for x, m in zip(points, mean, strict=True)]

    def central(order: int) -> Tensor:
        return Tensor.symmetric(n, order, lambda index: sum_over_nodes(w * _expected(index, d, each.cov)))

    cov = central(2)
    return dense(
        Components(
            Tensor.symmetric(n, 1, lambda i: mean[i[0]]),
            cov,
            central(3),
            fourth_coefficient(central(4), cov),
        )
    )


def _expected(index: tuple[int, ...], d: list[Any], P: Tensor) -> Any:
    """E of the product of the components in `index` of a Gaussian about d with covariance P, the last one known:
    d d d d + 6{P d d} + 3{P P} and its like, by taking the first factor alone or with each of the others."""
    if not index:
        return 1.0
    first, rest = index[0], index[1:]
    total = d[first] * _expected(rest, d, P)
    known = len(d) - 1
    for place, other in enumerate(rest):
        if known not in (first, other):
            total = total + P[first, other] * _expected(rest[:place] + rest[place + 1 :], d, P)
    return total


def _info(prior: State, posterior: State, each: Updated) -> UpdateInfo:
    """Mean and covariance of the mixture of the nodes' residuals, and what the data said."""
    w = _normalised(prior.log_weights)
    m = each.z.shape[0]
    mean = [sum_over_nodes(w * z) for z in each.z]
    cov = Tensor.symmetric(
        m,
        2,
        lambda rs: sum_over_nodes(
            w * (each.S_z[rs] + (each.z[rs[0]] - mean[rs[0]]) * (each.z[rs[1]] - mean[rs[1]]))
        ),
    )
    gained = jax.nn.logsumexp(posterior.log_weights) - jax.nn.logsumexp(prior.log_weights)
    return UpdateInfo(
        innovation=jnp.stack(mean),
        innovation_cov=cov.to_array(),
        log_likelihood=gained,
        nu=jnp.zeros(()),
        guarded=jnp.zeros((), bool),
    )
