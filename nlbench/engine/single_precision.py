"""Whether derivatives of a problem's functions survive float32, of which numbers far from one leave the range.

Nothing raises then. With lengths in feet the second derivatives of mu x / r^3, where mu = 1.7e14 and r = 6.2e6, pass
1e38 on their way and come out as zero: a second-order filter would be an EKF, and nobody be told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.errors import ConfigError, Problem
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.engine.problem import Runner
    from nlbench.systems.discrete import DiscreteSystem

APART = 0.01  # of the largest entry
ORDERS = ("values", "first derivatives", "second derivatives")  # of which filters make use


def check(runners: tuple[Runner, ...], units: tuple[str, ...] = ()) -> None:
    """Compare with float64 at the initial mean of each filter and one standard deviation from it along every state.

    units: the parameters by which the system's units can be chosen. Raises `ConfigError` with a line for each function
    whose values or derivatives differ by more than 1 %, and what to do.
    """
    found = [
        f"{name}: {ORDERS[order]} in float32 are {_off(apart)}, since numbers leave its range or cancel"
        for runner in runners
        for name, order, apart in _differences(runner)
    ]
    if found:
        where = f" (by {' and '.join(units)})" if units else ""
        advice = f"state the system in units in which its numbers are nearer to one{where}, or take precision: float64"
        raise ConfigError([Problem(each, "engine.precision") for each in [*dict.fromkeys(found), advice]])


def _off(apart: float) -> str:
    return f"off by {100 * apart:.0f} %" if np.isfinite(apart) else "lost"


def _differences(runner: Runner) -> Iterator[tuple[str, int, float]]:
    """Function, order of the derivative, and how far float32 is from float64: at most, as a share of the largest entry
    of the same row, both over all points and for steps of one standard deviation, so that units do not matter."""
    mean = np.asarray(runner.initial.mean, float)
    deviations = np.sqrt(np.diag(np.asarray(runner.initial.cov, float)))
    points = np.concatenate([mean[None], mean + np.diag(deviations), mean - np.diag(deviations)])
    for name, function in _functions(runner.filter.system):
        derivatives = [function, jax.jacfwd(function), jax.jacfwd(jax.jacfwd(function))]
        for order, derivative in enumerate(derivatives):
            exact = _at(derivative, points, deviations, order, True)
            found = _at(derivative, points, deviations, order, False)
            there = np.isfinite(exact)  # what float64 has not, float32 does not lose
            largest = np.abs(exact).max((0, 2), where=there, initial=0.0)
            apart = np.nan_to_num(np.abs(found - exact), nan=np.inf, posinf=np.inf).max(
                (0, 2), where=there, initial=0.0
            )
            with np.errstate(divide="ignore", invalid="ignore"):
                share = np.max(np.where(apart == 0, 0.0, apart / largest), initial=0.0)
            if share > APART:
                yield name, order, share
                break


def _at(
    derivative: Callable[[Any], Any], points: np.ndarray, deviations: np.ndarray, order: int, double: bool
) -> np.ndarray:
    """A derivative at points (p, n), for steps of one standard deviation: (p, rows, entries)."""
    with jax.enable_x64(double):
        values = jax.vmap(derivative)(jnp.asarray(points, jnp.float64 if double else jnp.float32))
    values = np.asarray(values, float)
    for axis in range(order):
        values = values * deviations.reshape(-1, *[1] * axis)
    return values.reshape(len(points), values.shape[1], -1) if order else values.reshape(len(points), -1, 1)


def _functions(system: System | DiscreteSystem) -> Iterator[tuple[str, Callable[[Any], Any]]]:
    """The functions of a state (n,) alone, at time zero and without noise."""
    if isinstance(system, System):
        seen = system.sighted(0) if system.sightings is not None else system
        yield "drift", lambda x: _stacked(system.drift_with_inputs(0.0, x))
        yield "observe", lambda x: _stacked(seen.observe(0.0, x))
        if system.diffusion is not None:
            yield "diffusion", partial(system.diffusion, 0.0)
    else:
        w, v = np.zeros(system.noises), np.zeros(len(system.measurement_cov))
        yield "transition", lambda x: _stacked(system.transition_with_inputs(0, x, w.astype(x.dtype)))
        yield "observe", lambda x: _stacked(system.observe_with_noise(0, x, v.astype(x.dtype)))


def _stacked(y: Any) -> Any:
    return jnp.stack(list(y)) if isinstance(y, (tuple, list)) else y
