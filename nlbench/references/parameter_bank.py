"""The exact posterior in discrete time of a system with one unknown constant, linear once that is known: a bank of
Kalman filters.

Given the constant z the other states x obey x+ = A x + a + G w and are measured as y = C x + c + D v, where A, a, G, C
and c may depend on z and k, so on a grid of nodes z_p
  (1) m_p = A m_p + a,  P_p = A P_p A' + G Q G'
and measurements and moments are those of `bank`. D may depend on neither. Cost: p Kalman filters.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import Tensor, einsum, expand
from nlbench.discrete.problem import is_bent, stacked
from nlbench.discrete.time import Clock
from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.moments.moments import Components, Moments, dense, to_full
from nlbench.references import bank
from nlbench.references.bank import State
from nlbench.references.dependence import depends
from nlbench.systems.discrete import DiscreteSystem
from nlbench.updates.measurement import Measurement, linearise
from nlbench.updates.posterior import through_gain

if TYPE_CHECKING:
    from nlbench.systems.exact import ParameterBank
    from nlbench.systems.system import System


class Seen(NamedTuple):
    """A measurement with additive noise, as `linearise` takes it: observe (t, x) -> (m,), innovation (y, h) -> (m,)."""

    observe: Any
    innovation: Any
    measurement_cov: Any

    @property
    def measurements(self) -> int:
        """Number of measurements m."""
        return len(self.measurement_cov)


def build(system: System | DiscreteSystem, record: ParameterBank) -> Filter:
    """The bank as a filter. `init` takes the prior from the record, whatever moments it is given.

    Raises `ConfigError` where the system is not linear once its last state is known, and where that is not constant.
    """
    if not isinstance(system, DiscreteSystem):
        raise ConfigError("exact: a parameter bank is for discrete time")
    _refuse(system)
    nodes, R = jnp.asarray(record.nodes), _noise(system)
    nothing = jnp.zeros(len(system.measurement_cov))

    def step(state: State, k: Any) -> State:
        move = lambda node, each: _moved(system, k, node, each)  # noqa: E731
        return state._replace(each=jax.vmap(move)(nodes, state.each))

    def update(state: State, t: Any, y: Any, key: Any = None) -> tuple[State, UpdateInfo]:
        def measure(node: Any, prior: Components) -> Measurement:
            observe = lambda t, x: _observed(system, t, jnp.append(x, node), nothing)  # noqa: E731
            return linearise(Seen(observe, system.innovation, R), t, prior, y, missing=True)

        return bank.update(measure, nodes, state)

    def rates(state: State, t: Any, y: Any = None) -> Moments:
        raise ConfigError("exact: moments have no time derivatives where time is discrete")

    clock = Clock.of_steps(step)
    return Filter(
        name="exact",
        system=system,
        init=lambda moments, key=None: bank.start(record),
        predict=lambda state, t0, t1, key=None: clock.predict(state, t0, t1),
        update=update,
        moments=lambda state: to_full(bank.moments(nodes, state)),
        rates=rates,
        integrate=clock.integrate,
        components=lambda state: bank.moments(nodes, state),
    )


def _moved(system: DiscreteSystem, k: Any, node: Any, each: Components) -> Components:
    """(1), for one node."""
    n, s = each.mean.shape[0], system.noises
    f = expand(
        lambda k, z: _next(system, k, jnp.append(z[:n], node), z[n:])[:n], k, [*each.mean, *(0.0,) * s], 1
    )
    assert f.first is not None
    of_state = {index: entry for index, entry in f.first.entries.items() if index[1] < n}
    of_noise = {(i, j - n): entry for (i, j), entry in f.first.entries.items() if j >= n}
    A, G = Tensor((n, n), ((0,), (1,)), of_state), Tensor((n, s), ((0,), (1,)), of_noise)
    Q = Tensor.from_array(np.asarray(system.process_cov, float), ((0, 1),))
    GQ = einsum("ia,ab->ib", G, Q)
    cov = through_gain(A, each.cov) + einsum("ib,jb->ij", GQ, G, sym="ij")
    return dense(Components(f.value, cov))


def _next(system: DiscreteSystem, k: Any, x: Any, w: Any) -> Any:
    return stacked(system.transition_with_inputs(k, x, w))


def _observed(system: DiscreteSystem, k: Any, x: Any, v: Any) -> Any:
    return stacked(system.observe_with_noise(k, x, v))


def _refuse(system: DiscreteSystem) -> None:
    """Raises `ConfigError` where the bank would not be exact."""
    n, s, q = system.states - 1, system.noises, len(system.measurement_cov)
    functions = {  # of what nothing is differentiated by, the time and the constant, and of the states and noises
        "transition": (lambda given, z: _next(system, given[0], jnp.append(z[:n], given[1]), z[n:])[:n], s),
        "observe": (lambda given, z: _observed(system, given[0], jnp.append(z[:n], given[1]), z[n:]), q),
    }
    bent = [name for name, (function, noises) in functions.items() if is_bent(function, 2, n + noises)]
    if bent:
        raise ConfigError(f"exact: {bent[0]} is not linear once the last state is known")
    x, w = jnp.asarray(system.initial.mean, float), jnp.zeros(s)
    last = lambda rest, x: _next(system, 0, x, rest)[n] - x[n]  # noqa: E731
    with jax.ensure_compile_time_eval():
        moves = jnp.append(jax.jacfwd(last, 1)(w, x), jax.jacfwd(last)(w, x))
        if jnp.any(moves != 0) or last(w, x) != 0:
            raise ConfigError("exact: the last state is not constant")


def _noise(system: DiscreteSystem) -> np.ndarray:
    """D R D', (m, m). Raises `ConfigError` where it depends on the state."""
    x, v = jnp.asarray(system.initial.mean, float), jnp.zeros(len(system.measurement_cov))
    D = lambda x, k: jax.jacfwd(lambda v: _observed(system, k, x, v))(v)  # noqa: E731
    if depends(D, x, 0) or depends(lambda k: D(x, k), 0):
        raise ConfigError("exact: the noise of a measurement depends on the state or on time")
    with jax.ensure_compile_time_eval():
        known = np.asarray(D(x, 0))
    return known @ np.asarray(system.measurement_cov, float) @ known.T
