"""A filter of a plug-in, bound to a system, its functions checked by shapes before anything is compiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp

from nlbench import plugins
from nlbench.errors import ConfigError, Problem
from nlbench.filters.filter import Filter, UpdateInfo

if TYPE_CHECKING:
    from nlbench.row import Row
    from nlbench.systems.discrete import DiscreteSystem
    from nlbench.systems.system import System


def build(name: str, row: Row, system: System | DiscreteSystem, options: Any) -> Filter:
    """What the plug-in's factory makes. Raises `ConfigError` with a line for everything that is wrong with it."""
    found = plugins.find("filters", name)
    assert found is not None
    plugin, entry = found
    made = plugins.made(plugin, f"filter '{name}'", entry, system, options)
    if not isinstance(made, Filter):
        wrong = [f"made a {type(made).__name__}, expected a nlbench.filters.filter.Filter"]
    else:
        wrong = list(misfits(made))
    if wrong:
        raise ConfigError([Problem(f"filter '{name}': {each}", file=plugin.path) for each in wrong])
    return made


def misfits(made: Filter) -> Iterator[str]:
    """What is wrong with what the functions of a filter return: a line for each, got and expected."""
    system = made.system
    n, m = system.states, system.measurements
    discrete = not hasattr(system, "drift")
    t, h = (0, 1) if discrete else (0.0, 0.1)
    try:
        state = _shapes("init(moments)", lambda: made.init(system.initial, jax.random.key(0)))
        moved = _shapes("integrate(state, t, h, count)", lambda s: made.integrate(s, t, h, 2), state)
        yield from _same("integrate(state, t, h, count)", moved, state)
        updated = _shapes("update(state, t, y)", lambda s, y: made.update(s, t, y), state, jnp.zeros(m))
        if not isinstance(updated, tuple) or len(updated) != 2 or not isinstance(updated[1], UpdateInfo):
            yield f"update(state, t, y): got {type(updated).__name__}, expected (state, UpdateInfo)"
        else:
            yield from _same("update(state, t, y)", updated[0], state)
            yield from _informed(updated[1], m)
        yield from _moments(_shapes("moments(state)", made.moments, state), n)
        yield from _components(_shapes("components(state)", made.components, state), n)
    except _Raised as error:
        yield str(error)


class _Raised(Exception):
    """A function of the filter raised; the others cannot be judged without its result."""


def _shapes(name: str, function: Callable, *arguments: Any) -> Any:
    """Shapes of what function(*arguments) returns; nothing is computed."""
    try:
        return jax.eval_shape(function, *arguments)
    except Exception as error:
        said = str(error).splitlines()[0] if str(error) else ""
        raise _Raised(f"{name}: raises {type(error).__name__}: {said}") from None


def _same(name: str, state: Any, expected: Any) -> Iterator[str]:
    """A state stays what it is: the loops of the engine carry it."""
    if jax.tree.structure(state) != jax.tree.structure(expected):
        yield f"{name}: got a state {jax.tree.structure(state)}, expected {jax.tree.structure(expected)} as of init"
        return
    for got, wanted in zip(jax.tree.leaves(state), jax.tree.leaves(expected), strict=True):
        if (got.shape, got.dtype) != (wanted.shape, wanted.dtype):
            said = f"got a part of the state of shape {got.shape} {got.dtype}"
            yield f"{name}: {said}, expected {wanted.shape} {wanted.dtype} as of init"


def _informed(info: UpdateInfo, m: int) -> Iterator[str]:
    expected: dict[str, tuple[int, ...]] = {"innovation": (m,), "innovation_cov": (m, m)}
    for name in UpdateInfo._fields:
        shape, wanted = jnp.shape(getattr(info, name)), expected.get(name, ())
        if shape != wanted:
            yield f"update(state, t, y): {name}: got shape {shape}, expected {wanted}"


def _moments(moments: Any, n: int) -> Iterator[str]:
    for name, wanted in (("mean", (n,)), ("cov", (n, n))):
        got = getattr(moments, name, None)
        if got is None or got.shape != wanted:
            yield f"moments(state): {name}: got {got if got is None else f'shape {got.shape}'}, expected {wanted}"


def _components(components: Any, n: int) -> Iterator[str]:
    """nlbench.moments.moments.Components, whose tensors hold unique components."""
    for name, wanted in (("mean", n), ("cov", n * (n + 1) // 2)):
        got = len(jax.tree.leaves(getattr(components, name, None)))
        if got != wanted:
            yield f"components(state): {name}: got {got} components, expected {wanted}; use to_components(moments, 2)"
