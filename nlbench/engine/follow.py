"""One filter over one block: moments at the output times, as unique components with the lanes last."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

if TYPE_CHECKING:
    from nlbench.engine.problem import Runner
    from nlbench.filters.filter import Filter
    from nlbench.schedule import Schedule


class Followed(NamedTuple):
    """Unique components of mean, covariance and third moment in one axis, (T, k, L), the start first; how many updates
    the guard replaced, (L,); and how many there were, (L,)."""

    components: Any
    guarded: Any
    updates: Any


def follow(runner: Runner, schedule: Schedule, measurements: Any, lanes: int, keys: Any = None) -> Followed:
    """The filter along the measurements (M, m, L) of a block. keys: (2, L), for a filter that draws random numbers."""
    filter = runner.filter
    start = begun(runner, lanes, keys)
    span = runner.step * runner.steps

    def segment(number: Any, carry: tuple[Any, Any]) -> tuple[Any, Any]:
        state, guarded = carry
        t = number * span
        if schedule.continuous:
            return held(number, carry)
        state = over_lanes(lambda state: filter.integrate(state, t, runner.step, runner.steps))(state)
        if schedule.measured_every == 0:
            return state, guarded
        if schedule.measured_every == 1:
            return measure(number, (state, guarded))
        due = (number + 1) % schedule.measured_every == 0
        return jax.lax.cond(due, measure, lambda _, carry: carry, number, (state, guarded))

    def measure(number: Any, carry: tuple[Any, Any]) -> tuple[Any, Any]:
        state, guarded = carry
        y = measurements[(number + 1) // schedule.measured_every - 1]
        t = (number + 1) * span
        state, info = over_lanes(lambda state, y: filter.update(state, t, y))(state, y)
        return state, guarded + info.guarded

    def held(number: Any, carry: tuple[Any, Any]) -> tuple[Any, Any]:
        """A step under the measurement at its start: a filter's update is the step, a reference must still move."""
        state, guarded = carry
        t = number * span
        state, info = over_lanes(lambda state, y: filter.update(state, t, y))(state, measurements[number])
        if filter.system.measurement == "discrete":
            state = over_lanes(lambda state: filter.integrate(state, t, runner.step, runner.steps))(state)
        return state, guarded + info.guarded

    def to_output(carry: tuple[Any, Any], output: Any) -> tuple[tuple[Any, Any], Any]:
        first = output * schedule.output_every
        if schedule.output_every == 1:
            carry = segment(first, carry)
        else:
            carry = jax.lax.fori_loop(first, first + schedule.output_every, segment, carry)
        return carry, emitted(filter, carry[0])

    carry = (start, jnp.zeros(lanes, int))
    (end, guarded), outputs = jax.lax.scan(to_output, carry, jnp.arange(schedule.outputs))
    components = joined(filter, schedule, start, outputs, end)
    return Followed(components, guarded, jnp.full(lanes, schedule.measurements))


def begun(runner: Runner, lanes: int, keys: Any) -> Any:
    """The state that the filter starts from, in every lane; with random numbers of its own, if it draws any."""
    if runner.filter.random:
        return over_lanes(lambda key: runner.filter.init(runner.initial, key))(keys)
    return jax.tree.map(
        lambda leaf: jnp.broadcast_to(jnp.asarray(leaf)[..., None], (*jnp.shape(leaf), lanes)),
        runner.filter.init(runner.initial),
    )


def emitted(filter: Filter, state: Any) -> Any:
    """The components (k, L) of a block's state; nothing of a filter that gives them at the end."""
    return None if filter.history else _stacked(over_lanes(filter.components)(state))


def joined(filter: Filter, schedule: Schedule, start: Any, outputs: Any, end: Any) -> Any:
    """The components (T, k, L) at all output times, from those emitted after the start, or from the state at the
    end."""
    if filter.history is None:
        return jnp.concatenate([emitted(filter, start)[None], outputs])
    history, steps = filter.history, schedule.output_every * schedule.segment_steps
    times = jnp.arange(schedule.outputs + 1) * steps * schedule.step
    return jnp.moveaxis(_stacked(over_lanes(lambda state: history(state, times))(end)), 0, 1)


def _stacked(components: Any) -> Any:
    """Mean, covariance and third moment in one first axis."""
    carried = [tensor for tensor in components[:3] if tensor is not None]
    return jnp.stack(
        [entry for tensor in carried for entry in tensor]
    )  # inside the vmap it would be transposed


def over_lanes(function: Any) -> Any:
    """A function of one trajectory for a block, with the lanes as the last axis."""
    return jax.vmap(function, in_axes=-1, out_axes=-1)
