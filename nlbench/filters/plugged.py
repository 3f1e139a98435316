"""A filter of a plug-in, bound to a system, its functions checked by shapes before anything is compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench import plugins
from nlbench.blame import explain
from nlbench.errors import ConfigError, Problem
from nlbench.filters.filter import Filter, UpdateInfo
from nlbench.systems.discrete import DiscreteSystem
from nlbench.systems.system import System

if TYPE_CHECKING:
    from nlbench.row import Row


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """What the plug-in's factory makes. Raises `ConfigError` with a line for everything that is wrong with it."""
    found = plugins.find("filters", name)
    assert found is not None
    plugin, entry = found
    made = plugins.made(plugin, f"filter '{name}'", entry, system, options)
    if not isinstance(made, Filter):
        wrong: list[str | Problem] = [
            f"made a {type(made).__name__}, expected a nlbench.filters.filter.Filter"
        ]
    else:
        wrong = list(misfits(made, system))
    if wrong:
        problems = [each if isinstance(each, Problem) else Problem(each, file=plugin.path) for each in wrong]
        raise ConfigError([each._replace(message=f"filter '{name}': {each.message}") for each in problems])
    return made


def misfits(made: Filter, system: System | DiscreteSystem) -> Iterator[str | Problem]:
    """What is wrong with what the functions of a filter return for a system: a line for each, got and expected."""
    n, m, own = system.states, system.measurements, made.system
    if not isinstance(own, (System, DiscreteSystem)) or (own.states, own.measurements) != (n, m):
        yield "system: expected the system that the factory is given, or one of as many states and measurements"
        return
    sightings = isinstance(system, System) and system.sightings is not None
    t, h = (0, 1) if isinstance(system, DiscreteSystem) else (0.0, 0.1)
    try:
        state = _shapes("init(moments)", lambda: made.init(system.initial, jax.random.key(0)))
        if not made.random:
            _shapes("init(moments), without a key since `random` is False", lambda: made.init(system.initial))
        moved = _shapes("integrate(state, t, h, count)", lambda s: made.integrate(s, t, h, 2), state)
        yield from _same("integrate(state, t, h, count)", moved, state)
        yield from _updated(made, state, t, m, sightings)
        yield from _moments(_shapes("moments(state)", made.moments, state), n)
        yield from _components(_shapes("components(state)", made.components, state), n)
        if sightings:
            yield from _angle(made, state)
    except _Raised as error:
        yield error.problem


class _Raised(Exception):
    """A function of the filter raised; the others cannot be judged without its result."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem


def _shapes(name: str, function: Callable, *arguments: Any) -> Any:
    """Shapes of what function(*arguments) returns; nothing is computed."""
    try:
        return jax.eval_shape(function, *arguments)
    except Exception as error:
        raise _Raised(explain(error, name)) from None


def _same(name: str, state: Any, expected: Any) -> Iterator[str]:
    """A state stays what it is: the loops of the engine carry it."""
    if jax.tree.structure(state) != jax.tree.structure(expected):
        yield f"{name}: got a state {jax.tree.structure(state)}, expected {jax.tree.structure(expected)} as of init"
        return
    for got, wanted in zip(jax.tree.leaves(state), jax.tree.leaves(expected), strict=True):
        if (got.shape, got.dtype) != (wanted.shape, wanted.dtype):
            part = f"got a part of the state of shape {got.shape} {got.dtype}"
            yield f"{name}: {part}, expected {wanted.shape} {wanted.dtype} as of init"


def _updated(made: Filter, state: Any, t: Any, m: int, sightings: bool) -> Iterator[str]:
    """An update by the measurement at a time, or by the sighting of a number where the system has sightings."""
    if sightings:
        name, number = "update(state, t, y, sighting=number)", jnp.zeros((), int)
        function = lambda s, y, number: made.update(s, t, y, sighting=number)  # noqa: E731
        updated = _shapes(name, function, state, jnp.zeros(m), number)
    else:
        name = "update(state, t, y)"
        updated = _shapes(name, lambda s, y: made.update(s, t, y), state, jnp.zeros(m))
    if not isinstance(updated, tuple) or len(updated) != 2 or not isinstance(updated[1], UpdateInfo):
        yield f"{name}: got {type(updated).__name__}, expected (state, UpdateInfo)"
        return
    yield from _same(name, updated[0], state)
    expected: dict[str, tuple[int, ...]] = {"innovation": (m,), "innovation_cov": (m, m)}
    for part, value in updated[1]._asdict().items():
        yield from _array(f"{name}: {part}", value, expected.get(part, ()))


def _angle(made: Filter, state: Any) -> Iterator[str]:
    """What sightings wait for."""
    if made.angle is None:
        yield "angle: got None, expected a function of the state, since the system has sightings"
    else:
        yield from _array("angle(state)", _shapes("angle(state)", made.angle, state), ())


def _array(name: str, value: Any, expected: tuple[int, ...]) -> Iterator[str]:
    shape = getattr(value, "shape", None)
    if shape != expected:
        got = f"shape {shape}" if shape is not None else "None" if value is None else type(value).__name__
        yield f"{name}: got {got}, expected {expected}"


def _moments(moments: Any, n: int) -> Iterator[str]:
    for name, wanted in (("mean", (n,)), ("cov", (n, n))):
        yield from _array(f"moments(state): {name}", getattr(moments, name, None), wanted)


def _components(components: Any, n: int) -> Iterator[str]:
    """nlbench.moments.moments.Components, whose tensors hold unique components."""
    for name, wanted in (("mean", n), ("cov", n * (n + 1) // 2)):
        got = len(jax.tree.leaves(getattr(components, name, None)))
        if got != wanted:
            yield f"components(state): {name}: got {got} components, expected {wanted}; use to_components(moments, 2)"
