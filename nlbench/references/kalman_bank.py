"""The exact posterior of a linear Gaussian system with one unknown constant: a bank of Kalman filters.

Given the constant z the state x obeys dx = A(z) x dt + noise of spectrum D, so on a grid of nodes z_p, over a time T
  (1) Phi = exp(A T),  Q = int_0^T exp(A s) D exp(A' s) ds,   both blocks of exp([[-A, D], [0, A']] T)
  (2) m_p = Phi m_p,  P_p = Phi P_p Phi' + Q
and at a measurement each filter makes a Kalman update, its weight multiplied by the density it had foretold:
  (3) log w_p += log N(y; h_p, S_p)
The posterior of (x, z) is a mixture; with d_p = (m_p, z_p) - m its moments are exact sums:
  (4) m = sum w_p (m_p, z_p),  cov = sum w_p (d d + P),  third = sum w_p (d d d + 3{P d}),
      fourth = sum w_p (d d d d + 6{P d d} + 3{P P})
(1) is formed while tracing where T is known then. Cost: p Kalman filters, p = 128 on the oscillator.
Source of (1): Van Loan 1978, IEEE Trans. Automatic Control 23, 395-404.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum, log_determinant
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.closures import fourth_coefficient
from nlbench.moments.moments import Components, Moments, dense, to_full
from nlbench.references.sums import total as sum_over_nodes
from nlbench.updates.kalman import kalman
from nlbench.updates.measurement import gain, linearise
from nlbench.updates.posterior import through_gain

if TYPE_CHECKING:
    from nlbench.systems.system import KalmanBank, System


class State(NamedTuple):
    """Logarithm of the nodes' weights (p,), up to a constant; mean and covariance of each filter, components (p,)."""

    log_weights: Any
    each: Components


def build(system: System, bank: KalmanBank) -> Filter:
    """The bank as a filter. `init` takes the prior from the bank, whatever moments it is given."""
    nodes = jnp.asarray(bank.nodes)

    def init(moments: Moments, key: Any = None) -> State:
        mean, cov = (
            Tensor.from_array(jnp.asarray(part, float), symmetry)
            for part, symmetry in ((bank.mean, ((0,),)), (bank.cov, ((0, 1),)))
        )
        everywhere = lambda leaf: jnp.full(nodes.shape, leaf)  # noqa: E731
        return State(jnp.log(jnp.asarray(bank.weights)), jax.tree.map(everywhere, Components(mean, cov)))

    def integrate(state: State, t: Any, h: Any, count: Any) -> State:
        carried = jax.vmap(_carried)(state.each, *_transition(bank, h * count))
        return state._replace(each=carried)

    def update(state: State, t: Any, y: Any, key: Any = None) -> tuple[State, UpdateInfo]:
        each = jax.vmap(lambda node, prior: _updated(system, t, node, prior, y))(nodes, state.each)
        posterior = State(state.log_weights + each.log_density, each.moments)  # (3)
        return posterior, _info(state, posterior, each)

    return Filter(
        name="exact",
        system=system,
        init=init,
        predict=lambda state, t0, t1, key=None: integrate(state, t0, t1 - t0, 1),
        update=update,
        moments=lambda state: to_full(_moments(nodes, state)),
        rates=lambda state, t, y=None: _rates(bank, nodes, state),
        integrate=integrate,
        components=lambda state: _moments(nodes, state),
    )


def _transition(bank: KalmanBank, T: Any) -> tuple[Tensor, Tensor | None]:
    """(1), as components (p,)."""
    if isinstance(T, (int, float)):
        with jax.ensure_compile_time_eval():
            return _exponentials(bank, T)
    return _exponentials(bank, T)


def _exponentials(bank: KalmanBank, T: Any) -> tuple[Tensor, Tensor | None]:
    A = jnp.asarray(bank.drift)
    k = A.shape[1]
    if bank.spectrum is None:
        return _matrix(jax.scipy.linalg.expm(A * T), ((0,), (1,))), None
    D = jnp.broadcast_to(jnp.asarray(bank.spectrum), A.shape)
    blocks = jnp.block([[-A, D], [jnp.zeros_like(A), A.mT]])
    exponential = jax.scipy.linalg.expm(blocks * T)
    Phi = exponential[:, k:, k:].mT
    return _matrix(Phi, ((0,), (1,))), _matrix(Phi @ exponential[:, :k, k:], ((0, 1),))


def _matrix(array: Any, symmetry: Any) -> Tensor:
    """Components (p,) of a matrix for each node, (p, k, k)."""
    k = array.shape[1]
    entries = {(i, j): array[:, i, j] for i in range(k) for j in range(k)}
    symmetric = symmetry == ((0, 1),)
    return Tensor((k, k), symmetry, {ij: v for ij, v in entries.items() if not symmetric or ij[0] <= ij[1]})


def _carried(each: Components, Phi: Tensor, Q: Tensor | None) -> Components:
    """(2), for one node."""
    cov = through_gain(Phi, each.cov)
    return Components(through_gain(Phi, each.mean), cov if Q is None else cov + Q)


class Updated(NamedTuple):
    """One node's filter after a measurement; the density (3) in logarithms, residual and its covariance."""

    moments: Components
    log_density: Any
    z: Tensor
    S_z: Tensor


def _updated(system: System, t: Any, node: Any, prior: Components, y: Any) -> Updated:
    """The Kalman update of one node's filter."""
    conditional = dataclasses.replace(system, observe=lambda t, x: system.observe(t, jnp.append(x, node)))
    measurement = linearise(conditional, t, prior, y, missing=True)
    gained = gain(prior.cov, measurement)
    z = measurement.z
    distance = einsum("r,r->", einsum("rs,s->r", gained.W, z), z)[()]
    level = distance + log_determinant(gained.S_z) + measurement.taken * math.log(2 * math.pi)
    return Updated(dense(kalman(prior, gained, z, z).moments), -0.5 * level, z.dense(), gained.S_z.dense())


def _normalised(log_weights: Any) -> Any:
    weights = jnp.exp(log_weights - jnp.max(log_weights))
    return weights / sum_over_nodes(weights)


def _moments(nodes: Any, state: State) -> Components:
    """(4), the fourth as a Hermite coefficient."""
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


def _rates(bank: KalmanBank, nodes: Any, state: State) -> Moments:
    """Derivatives of the moments with the weights held, as they are between measurements: A m, A P + P A' + D."""
    A = _matrix(jnp.asarray(bank.drift), ((0,), (1,)))
    D = np.zeros(np.shape(bank.cov)) if bank.spectrum is None else np.asarray(bank.spectrum, float)

    def slope(A: Tensor, each: Components) -> Components:
        AP = einsum("ie,je->ij", A, each.cov)
        k = AP.shape[0]
        cov = Tensor.symmetric(k, 2, lambda ij: AP[ij] + AP[ij[::-1]] + D[ij])
        return dense(Components(einsum("ie,e->i", A, each.mean), cov))

    slopes = jax.vmap(slope)(A, state.each)
    moments = lambda each: to_full(_moments(nodes, state._replace(each=each)))  # noqa: E731
    return jax.jvp(moments, (state.each,), (slopes,))[1]


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
