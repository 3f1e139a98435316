"""What a filter is: a record of pure functions of one trajectory, without a batch axis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from nlbench.algebra import Tensor
    from nlbench.systems.system import System


class UpdateInfo(NamedTuple):
    """What an update learned on its way.

    innovation: (m,), y - h at the prior mean, zero where y is NaN. innovation_cov: (m, m).
    log_likelihood: logarithm of the predictive density of the entries taken.
    nu: 1 + nu is the ratio of the predictive density to the Gaussian one (0 for a Gaussian prior).
    guarded: whether the guard replaced the update.
    """

    innovation: Any
    innovation_cov: Any
    log_likelihood: Any
    nu: Any
    guarded: Any


class Filter(NamedTuple):
    """A filter bound to a system. `state` is a pytree that only the filter's own functions look into.

    init: (moments, key=None) -> state.
    predict: (state, t0, t1, key=None) -> state.
    update: (state, t, y, key=None, sighting=None) -> (state, UpdateInfo); NaN in y (m,) means that entry was not taken.
        sighting: number of the sighting that y is, where the system has `sightings`.
    moments: state -> Moments, full arrays.
    rates: (state, t, y=None) -> Moments, their time derivatives between measurements.
    integrate: (state, t, h, count) -> state, `count` steps of h from t; what `predict` and the engine call.
    components: state -> Components, the unique components of the moments.
    random: whether it draws random numbers, from the key that `init` is given.
    angle: state -> the central angle that sightings wait for; None without sightings.
    history: (state, times (T,)) -> Components (T,): the moments at earlier times, for a filter that remembers all it
        needs and computes them dearly; the engine then asks for them once, at the end. None for the others.
    limiter: how many standard deviations its residuals are clipped at; None if they are not.
    step: the longest step of its predictions, 1 where time is discrete; None means a tenth of each way.
    """

    name: str
    system: System
    init: Callable
    predict: Callable
    update: Callable
    moments: Callable
    rates: Callable
    integrate: Callable
    components: Callable
    random: bool = False
    angle: Callable | None = None
    history: Callable | None = None
    limiter: float | None = None
    step: float | None = None


def central_angle(system: System, mean: Tensor) -> Any:
    """The central angle of a mean, by the system's sightings; no array is formed of it."""
    import jax.numpy as jnp

    from nlbench.algebra import expand

    sightings = system.sightings
    assert sightings is not None
    return expand(lambda t, x: jnp.stack([sightings.angle(x)]), 0.0, list(mean), 0).value[0]
