"""Whether derivatives of a problem's functions survive float32, of which numbers far from one leave the range.

Nothing raises then. With lengths in feet the second derivatives of mu x / r^3, where mu = 1.7e14 and r = 6.2e6, pass
1e38 on their way and come out as zero: a second-order filter would be an EKF, and nobody be told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.simulate import path
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.engine.problem import Runner
    from nlbench.schedule import Schedule
    from nlbench.systems.discrete import DiscreteSystem

APART = 0.01  # of the largest entry
LOOKS = 8  # times at which is looked, after the start
ORDERS = ("values", "first derivatives", "second derivatives")  # of which filters make use


def check(runners: tuple[Runner, ...], times: Schedule, units: tuple[str, ...] = ()) -> None:
    """Compare with float64 at the initial mean of each filter, one standard deviation from it along every state, and
    on the paths that its model takes from there.

    units: the parameters by which the system's units can be chosen. Raises `ConfigError` with a line for each function
    whose values or derivatives differ by more than 1 %, and what to do.
    """
    found = [
        f"{name}: {ORDERS[order]} in float32 are {_off(apart)}, since numbers leave its range or cancel"
        for runner in {_seen(runner): runner for runner in runners}.values()
        for name, order, apart in _differences(runner, times)
    ]
    if found:
        where = f" (by {' and '.join(units)})" if units else ""
        advice = f"state the system in units in which its numbers are nearer to one{where}, or take precision: float64"
        raise ConfigError([Problem(each, "engine.precision") for each in [*dict.fromkeys(found), advice]])


def _seen(runner: Runner) -> tuple[int, bytes, bytes]:
    """What of a filter is looked at: its model and its start."""
    initial = runner.initial
    return id(runner.filter.system), np.asarray(initial.mean).tobytes(), np.asarray(initial.cov).tobytes()


def _off(apart: float) -> str:
    return f"off by {100 * apart:.0f} %" if np.isfinite(apart) else "lost"


def _differences(runner: Runner, times: Schedule) -> Iterator[tuple[str, int, float]]:
    """Each function that does not survive, the order of its first derivative that does not, and how far that is off."""
    points = _points(runner, times)
    for name, function in _functions(runner.filter.system):
        derivatives = [function, jax.jacfwd(function, 1), jax.jacfwd(jax.jacfwd(function, 1), 1)]
        for order, derivative in enumerate(derivatives):
            if (apart := _apart(derivative, points, order)) > APART:
                yield name, order, apart
                break


@np.errstate(divide="ignore", invalid="ignore", over="ignore")
def _apart(derivative: Callable[[Any, Any], Any], points: _Points, order: int) -> float:
    """How far float32 is from float64: at most, as a share of the largest entry of the same row, both over all points
    and for steps of one standard deviation, so that units do not matter."""
    exact, found = _at(derivative, points, order, True), _at(derivative, points, order, False)
    there = np.isfinite(exact)  # what float64 has not, float32 does not lose
    largest = np.abs(exact).max((0, 2), where=there, initial=0.0)
    apart = np.nan_to_num(np.abs(found - exact), nan=np.inf, posinf=np.inf)
    apart = apart.max((0, 2), where=there, initial=0.0)
    return float(np.max(np.where(apart == 0, 0.0, apart / largest), initial=0.0))


class _Points(NamedTuple):
    """Times (p,), states (p, n), and standard deviations of the states (n,)."""

    times: np.ndarray
    states: np.ndarray
    deviations: np.ndarray


def _points(runner: Runner, times: Schedule) -> _Points:
    """Where the functions are compared: the starts, and paths from them, each with a process noise of its own."""
    system, initial = runner.filter.system, runner.initial
    mean = np.asarray(initial.mean, float)
    deviations = np.sqrt(np.diag(np.asarray(initial.cov, float)))
    starts = np.concatenate([mean[None], mean + np.diag(deviations), mean - np.diag(deviations)])
    looks = np.unique(np.linspace(0, times.segments, LOOKS + 1).round().astype(int))[1:]
    with jax.enable_x64(True):
        keys = jax.random.split(jax.random.key(0), len(starts))
        paths = jax.jit(jax.vmap(partial(path, system, times)))(keys, jnp.asarray(starts))
    later = np.asarray(paths)[:, looks - 1]
    spread = np.where(np.isfinite(later), later, mean).std(0).max(0)
    at = np.array(times.segment_times)[[*np.repeat(0, len(starts)), *np.tile(looks, len(starts))]]
    states = np.concatenate([starts, later.reshape(-1, len(mean))])
    return _Points(at, states, np.where(deviations > 0, deviations, spread))


def _at(derivative: Callable[[Any, Any], Any], points: _Points, order: int, double: bool) -> np.ndarray:
    """A derivative at points, for steps of one standard deviation: (p, rows, entries)."""
    with jax.enable_x64(double):
        kind = jnp.float64 if double else jnp.float32
        values = jax.jit(jax.vmap(derivative))(jnp.asarray(points.times), jnp.asarray(points.states, kind))
    values = np.asarray(values, float)
    for axis in range(order):
        values = values * points.deviations.reshape(-1, *[1] * axis)
    count = len(points.times)
    return values.reshape(count, values.shape[1], -1) if order else values.reshape(count, -1, 1)


def _functions(system: System | DiscreteSystem) -> Iterator[tuple[str, Callable[[Any, Any], Any]]]:
    """The functions of time and state (n,) alone, without noise."""
    if isinstance(system, System):
        seen = system.sighted(0) if system.sightings is not None else system
        yield "drift", lambda t, x: _stacked(system.drift_with_inputs(t, x))
        yield "observe", lambda t, x: _stacked(seen.observe(t, x))
        if system.diffusion is not None:
            yield "diffusion", system.diffusion
    else:
        w, v = np.zeros(system.noises), np.zeros(len(system.measurement_cov))
        yield "transition", lambda k, x: _stacked(system.transition_with_inputs(k, x, w.astype(x.dtype)))
        yield "observe", lambda k, x: _stacked(system.observe_with_noise(k, x, v.astype(x.dtype)))


def _stacked(y: Any) -> Any:
    return jnp.stack(list(y)) if isinstance(y, (tuple, list)) else y
