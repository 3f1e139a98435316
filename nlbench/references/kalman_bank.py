"""The exact posterior of a linear Gaussian system with one unknown constant: a bank of Kalman filters.

Given the constant z the state x obeys dx = A(z) x dt + noise of spectrum D, so on a grid of nodes z_p, over a time T
  (1) Phi = exp(A T),  Q = int_0^T exp(A s) D exp(A' s) ds,   both blocks of exp([[-A, D], [0, A']] T)
  (2) m_p = Phi m_p,  P_p = Phi P_p Phi' + Q
and measurements and moments are those of `bank`.
(1) is formed while tracing where T is known then. Cost: p Kalman filters, p = 128 on the oscillator.
Source of (1): Van Loan 1978, IEEE Trans. Automatic Control 23, 395-404.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.moments import Components, Moments, dense, to_full
from nlbench.references import bank
from nlbench.references.bank import State
from nlbench.updates.measurement import Measurement, linearise
from nlbench.updates.posterior import through_gain

if TYPE_CHECKING:
    from nlbench.systems.exact import KalmanBank
    from nlbench.systems.system import System


def build(system: System, record: KalmanBank) -> Filter:
    """The bank as a filter. `init` takes the prior from the record, whatever moments it is given."""
    nodes = jnp.asarray(record.nodes)

    def integrate(state: State, t: Any, h: Any, count: Any) -> State:
        carried = jax.vmap(_carried)(state.each, *_transition(record, h * count))
        return state._replace(each=carried)

    def update(state: State, t: Any, y: Any, key: Any = None) -> tuple[State, UpdateInfo]:
        def measure(node: Any, prior: Components) -> Measurement:
            conditional = replace(system, observe=lambda t, x: system.observe(t, jnp.append(x, node)))
            return linearise(conditional, t, prior, y, missing=True)

        return bank.update(measure, nodes, state)

    return Filter(
        name="exact",
        system=system,
        init=lambda moments, key=None: bank.start(record),
        predict=lambda state, t0, t1, key=None: integrate(state, t0, t1 - t0, 1),
        update=update,
        moments=lambda state: to_full(bank.moments(nodes, state)),
        rates=lambda state, t, y=None: _rates(record, nodes, state),
        integrate=integrate,
        components=lambda state: bank.moments(nodes, state),
    )


def _transition(record: KalmanBank, T: Any) -> tuple[Tensor, Tensor | None]:
    """(1), as components (p,)."""
    if isinstance(T, (int, float)):
        with jax.ensure_compile_time_eval():
            return _exponentials(record, T)
    return _exponentials(record, T)


def _exponentials(record: KalmanBank, T: Any) -> tuple[Tensor, Tensor | None]:
    A = jnp.asarray(record.drift)
    k = A.shape[1]
    if record.spectrum is None:
        return _matrix(jax.scipy.linalg.expm(A * T), ((0,), (1,))), None
    D = jnp.broadcast_to(jnp.asarray(record.spectrum), A.shape)
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


def _rates(record: KalmanBank, nodes: Any, state: State) -> Moments:
    """Derivatives of the moments with the weights held, as they are between measurements: A m, A P + P A' + D."""
    A = _matrix(jnp.asarray(record.drift), ((0,), (1,)))
    D = np.zeros(np.shape(record.cov)) if record.spectrum is None else np.asarray(record.spectrum, float)

    def slope(A: Tensor, each: Components) -> Components:
        AP = einsum("ie,je->ij", A, each.cov)
        k = AP.shape[0]
        cov = Tensor.symmetric(k, 2, lambda ij: AP[ij] + AP[ij[::-1]] + D[ij])
        return dense(Components(einsum("ie,e->i", A, each.mean), cov))

    slopes = jax.vmap(slope)(A, state.each)
    moments = lambda each: to_full(bank.moments(nodes, state._replace(each=each)))  # noqa: E731
    return jax.jvp(moments, (state.each,), (slopes,))[1]
