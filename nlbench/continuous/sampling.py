"""Filters of continuous measurements on sampled ones: sample-and-hold, and pulses (Schwartz 1967, 5.4).

A step of length h sees white noise of spectral density Gamma as noise of variance Gamma/h. Where only one measurement
in a period T is taken,
  held    it stands in until the next; noise of that variance held over T has the spectral density Gamma T/h: "the
          effective noise variance was obtained using a dt equal to the sampling period" (inferred: of that variance)
  pulses  it counts for its step, and Gamma^-1 is zero over the others
Both know the same, the share h/T of the data. A period is a whole number of steps, and the first sample is at time 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from nlbench.errors import ConfigError
from nlbench.filters.filter import Filter, UpdateInfo

if TYPE_CHECKING:
    from nlbench.systems.system import System


class Held(NamedTuple):
    """A filter's state, and the last sample (m,)."""

    inner: Any
    sample: Any


def sampled(name: str, system: System, h: float, bind: Callable[[System], Filter]) -> Filter:
    """The filter that `bind` makes of a system without sampling, on that system's samples.

    Raises `ConfigError` where the period is not a whole number of steps h.
    """
    assert system.sampling is not None
    period, held = system.sampling
    every = round(period / h)
    if every < 1 or abs(every * h - period) > 1e-9 * period:
        raise ConfigError(f"{name}: the sampling period {period:g} is not a multiple of the step {h:g}")
    due = lambda t: jnp.round(t / h).astype(int) % every == 0  # noqa: E731
    pulsed = _pulsed(bind(replace(system, sampling=None)), due)
    if not held:
        return pulsed._replace(system=system)
    spread = every * np.asarray(system.measurement_cov, float)
    held_on = bind(replace(system, sampling=None, measurement_cov=spread))
    return _holding(held_on, pulsed, due)._replace(system=system)


def _pulsed(filter: Filter, due: Callable) -> Filter:
    def update(state: Any, t: Any, y: Any, key: Any = None, sighting: Any = None) -> tuple[Any, UpdateInfo]:
        return filter.update(state, t, jnp.where(due(t), jnp.asarray(y), jnp.nan))

    return filter._replace(update=update)


def _holding(filter: Filter, pulsed: Filter, due: Callable) -> Filter:
    """pulsed: says what a sample tells, which counts once however long it is held."""
    m = filter.system.measurements

    def update(state: Held, t: Any, y: Any, key: Any = None, sighting: Any = None) -> tuple[Held, UpdateInfo]:
        sample = jnp.where(due(t), jnp.asarray(y), state.sample)
        inner, _ = filter.update(state.inner, t, sample)
        return Held(inner, sample), pulsed.update(state.inner, t, y)[1]

    return filter._replace(
        init=lambda moments, key=None: Held(filter.init(moments), jnp.full(m, jnp.nan)),
        update=update,
        moments=lambda state: filter.moments(state.inner),
        rates=lambda state, t, y=None: filter.rates(state.inner, t, y),
        integrate=lambda state, t, h, count: state._replace(inner=filter.integrate(state.inner, t, h, count)),
        components=lambda state: filter.components(state.inner),
    )
