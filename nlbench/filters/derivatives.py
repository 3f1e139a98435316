"""Functions of a system, or derivatives of them, that are not finite where a filter starts: refused before a run.

A derivative that is not finite makes every estimate NaN from there on. A filter takes the drift, or the transition, and
the diffusion at its initial mean, and the measurement at the mean of its first one, which the filter itself predicts.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.algebra import expand
from nlbench.algebra.scalars import is_known
from nlbench.algebra.singular import may_be_singular
from nlbench.continuous.second_order import FILTERS
from nlbench.errors import ConfigError, Problem
from nlbench.shapes import stacked
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import System, kind, state_names

if TYPE_CHECKING:
    from nlbench.filters.filter import Filter
    from nlbench.row import Row


class Orders(NamedTuple):
    """The highest order of derivatives, 0 for the function itself, that a filter takes at its mean: of the drift or the
    transition, the diffusion, and the measurement. None: it does not take the function there."""

    motion: int | None
    diffusion: int | None
    observe: int | None


class Singular(NamedTuple):
    """A function that is not finite at a point: the lowest order of its derivatives that is not, by which variables."""

    order: int
    variables: tuple[str, ...]


class _Function(NamedTuple):
    """A function of z (p,), the state and whatever noise it takes, and the names of z."""

    function: Callable[[Any], Any]
    z: np.ndarray
    names: tuple[str, ...]


ROUNDING = 1e-9  # as a share of a standard deviation, which a mean that does not move may still move by
AROUND = Orders(None, None, 0)  # points around the mean, but for the centre of residuals
DISCRETE = {
    "kalman": Orders(1, 0, 1),
    "iterated": Orders(1, 0, 1),
    "sof": Orders(2, 1, 2),
    "truncated": Orders(2, 2, 2),
    "statistical": Orders(0, 0, 0),
    "sigma_point": Orders(0, 0, 0),
}
CONTINUOUS = {"kushner": Orders(2, 2, 2), "nominal": Orders(1, 0, 1), "weighted": Orders(2, 1, 2)}


def find_orders(name: str, row: Row, options: Any) -> Orders | None:
    """Return what a filter of the catalogue takes at its mean; None where that is not known, or left to chance."""
    if row.family == "moment":
        curved = row.update == "two-step" or getattr(options, "measurement", "") == "quadratic"
        return Orders(1 if row.order == 1 else 2, 0 if row.order == 1 else 2, 2 if curved else 1)
    if row.family == "continuous":
        if row.update in CONTINUOUS:
            return CONTINUOUS[row.update]
        order = FILTERS[row.update].order
        return Orders(order, 0 if order == 1 else 2, row.order)
    if row.family == "baseline":
        return Orders(None, None, 1)
    if row.family != "discrete" or row.update in ("ensemble", "bootstrap"):
        return None
    if row.update == "gaussian_sum":
        central = options.components % 2  # whether a Gaussian lies at the mean
        return DISCRETE["kalman" if options.bank == "ekf" else "sof"] if central else None
    if name == "ckf" or getattr(options, "points", 1) % 2 == 0:
        return AROUND
    found = DISCRETE.get(row.update)
    return found._replace(diffusion=0) if found and name == "sof" else found


def refuse_singular(name: str, row: Row, options: Any, bound: Filter) -> None:
    """Raises `ConfigError` with a line for each function that is not finite, or has no derivative, where a filter needs
    it. A filter that is bound while jax traces is let through."""
    needed = find_orders(name, row, options)
    if needed is None or isinstance(jnp.zeros(()), jax.core.Tracer):
        return
    system, nominal = bound.system, getattr(options, "nominal", None)
    if nominal is not None:
        mean = np.atleast_1d(np.asarray(nominal, float))
        system = replace(system, initial=system.initial._replace(mean=mean))
    found = _needed(find_singular(system), needed, row)
    place = f"at the initial mean {_shown(system.initial.mean)}, where {name} starts"
    moves = not kind(system).continuous and found and found.keys() <= {"observe", "residual"}
    mean = _predicted(bound, system) if moves else None
    if mean is not None and _is_apart(mean, system):
        found = _needed(_search(system, mean, ("observe", "residual")), needed, row)
        place = f"at {_shown(mean)}, the mean of {name} at its first measurement"
    if found:
        seen = kind(system).continuous
        raise ConfigError([Problem(_sentence(of, each, place, seen)) for of, each in found.items()])


def _needed(found: dict[str, Singular], needed: Orders, row: Row) -> dict[str, Singular]:
    """Those of the functions that matter to a filter."""
    highest = {
        "drift": needed.motion,
        "transition": needed.motion,
        "diffusion": needed.diffusion,
        "observe": needed.observe,
        "residual": 1 if row.update == "quadrature" else 0,
    }
    orders = {name: -1 if order is None else order for name, order in highest.items()}
    return {name: each for name, each in found.items() if each.order <= orders[name]}


def _predicted(bound: Filter, system: System | DiscreteSystem) -> np.ndarray | None:
    """The mean of the filter at its first measurement; None where that is not finite."""

    def mean() -> Any:
        return bound.moments(bound.predict(bound.init(system.initial), *_first(system, bound.step))).mean

    found = np.asarray(jax.jit(mean)(), float)
    return found if np.isfinite(found).all() else None


def _is_apart(mean: np.ndarray, system: System | DiscreteSystem) -> bool:
    """Whether a mean is another than the initial one, rounding left out."""
    deviations = np.sqrt(np.abs(np.diag(np.asarray(system.initial.cov, float))))
    return bool((np.abs(mean - np.asarray(system.initial.mean, float)) > ROUNDING * deviations).any())


def _first(system: System | DiscreteSystem, step: float | None = None) -> tuple[Any, Any]:
    """The start, and when is measured first, or might be where no interval says it."""
    if isinstance(system, DiscreteSystem):
        return 0, round(system.interval or 1)
    return 0.0, float(system.interval or step or system.default_step or 1.0)


_KNOWN: dict[int, tuple[weakref.ref, dict[str, Singular]]] = {}  # by the identity of a system


def find_singular(system: System | DiscreteSystem) -> dict[str, Singular]:
    """Find the functions of a system that are not finite at its initial mean, or have a first or second derivative that
    is not. Remembered as long as the system lives."""
    key = id(system)
    if key not in _KNOWN:
        found = _search(system, np.asarray(system.initial.mean, float))
        _KNOWN[key] = weakref.ref(system, lambda _: _KNOWN.pop(key, None)), found
    return _KNOWN[key][1]


def _search(system: Any, mean: np.ndarray, names: tuple[str, ...] = ()) -> dict[str, Singular]:
    """The same at any mean, of all functions or those of these names."""
    functions = {name: each for name, each in _functions(system, mean) if not names or name in names}

    def values(*points: Any) -> list[Any]:
        return [each.function(z) for each, z in zip(functions.values(), points, strict=True)]

    if not may_be_singular(values, *(each.z for each in functions.values())):
        return {}
    found = {name: _singular(each) for name, each in functions.items()}
    if found["observe"] is not None:
        found.pop("residual", None)
    return {name: each for name, each in found.items() if each is not None}


def _functions(system: System | DiscreteSystem, mean: np.ndarray) -> Iterator[tuple[str, _Function]]:
    """Each function at the time at which a filter first takes it."""
    n, states = len(mean), tuple(state_names(len(mean)))
    seen, (start, first) = system, _first(system)

    def noisy(function: Callable, k: Any, letter: str, s: int) -> _Function:
        names = (letter,) if s == 1 else tuple(f"{letter}{i + 1}" for i in range(s))
        z = np.concatenate([mean, np.zeros(s)])
        return _Function(lambda z: stacked(function(k, z[:n], z[n:])), z, (*states, *names))

    if isinstance(system, DiscreteSystem):
        yield "transition", noisy(system.transition_with_inputs, start, "w", system.noises)
        observe = noisy(system.observe_with_noise, first, "v", len(system.measurement_cov))
    else:
        yield "drift", _Function(lambda x: stacked(system.drift_with_inputs(start, x)), mean, states)
        if system.diffusion is not None:
            diffusion = system.diffusion
            yield "diffusion", _Function(lambda x: jnp.asarray(diffusion(start, x)), mean, states)
        seen = system.sighted(0) if system.sightings is not None else system
        first = start if kind(system).continuous else first
        observe = _Function(lambda x: stacked(seen.observe(first, x)), mean, states)
    yield "observe", observe
    if system.residual is not None:
        residual = system.residual

        def expected(z: Any) -> Any:
            h = observe.function(z)
            return residual(jax.lax.stop_gradient(h), h)

        yield "residual", observe._replace(function=expected)


def _singular(of: _Function) -> Singular | None:
    """The lowest order that is not finite at the point; None where all are."""
    f = of.function
    first = jax.jacfwd(f)
    for order, values in enumerate(jax.jit(lambda z: (f(z), first(z), jax.jacfwd(first)(z)))(of.z)):
        wrong = ~np.isfinite(np.asarray(values))
        if wrong.any():
            return Singular(order, _variables(of, order, wrong) if order else ())
    return None


def _variables(of: _Function, order: int, wrong: np.ndarray) -> tuple[str, ...]:
    """By which variables a derivative is not finite, without those by which it is a constant, whatever the point."""
    depends = np.zeros(wrong.shape, bool)

    def mark(z: Any) -> None:
        taylor = expand(lambda t, z: of.function(z), 0.0, list(z), order)
        tensor = taylor.first if order == 1 else taylor.second
        assert tensor is not None
        for index, entry in tensor.entries.items():
            depends[index] = not is_known(entry)

    jax.eval_shape(mark, of.z)
    chosen = wrong & depends if (wrong & depends).any() else wrong
    axes = np.argwhere(chosen)[:, wrong.ndim - order :]
    return tuple(of.names[i] for i in sorted(set(axes.ravel().tolist())))


def _sentence(function: str, each: Singular, place: str, continuous: bool) -> str:
    if each.order == 0:
        return f"{function}: is not finite {place}; move the start, or write the function so that it is finite there"
    names = " and ".join(part for part in (", ".join(each.variables[:-1]), each.variables[-1]) if part)
    derivative = "derivative" if each.order == 1 else "second derivative"
    others = "" if continuous else ", or take ukf, ckf or ghkf, which need none"
    if each.order == 2:
        others = ", or take ekf, which needs first derivatives only"
    return (
        f"{function}: its {derivative} by {names} is not finite {place}; move the start, write the function so that "
        f"the derivative exists there (jnp.where on the argument of the root, not on its result){others}"
    )


def _shown(mean: Any) -> str:
    return f"({', '.join(f'{value:g}' for value in np.asarray(mean, float))})"
