"""One filter over one block: moments at the output times, as unique components with the lanes last."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.engine.scores import Score, added, emptied, nothing, score
from nlbench.statistics.tracks import Scores

if TYPE_CHECKING:
    from nlbench.engine.problem import Runner
    from nlbench.filters.filter import Filter
    from nlbench.schedule import Schedule


class Followed(NamedTuple):
    """Unique components of mean, covariance and third moment in one axis, (T, k, L), the start first; how many updates
    the guard replaced, (L,); how many there were, (L,); whether what the filter stated before any update so far was
    beyond all sense, (T, L); and the scores (T, L), if they were asked for."""

    components: Any
    guarded: Any
    updates: Any
    senseless: Any = False
    scores: Scores | None = None


class Carried(NamedTuple):
    """Of a block: the filter's state; in how many updates the guard replaced it, (L,); whether it was beyond all sense
    before one, (L,); the scores since the last output, (L,), if they were asked for."""

    state: Any
    guarded: Any
    senseless: Any
    scores: Scores | None


def follow(
    runner: Runner,
    schedule: Schedule,
    measurements: Any,
    lanes: int,
    keys: Any = None,
    scores: bool = False,
    most: Any = None,
) -> Followed:
    """The filter along the measurements (M, m, L) of a block. keys: (2, L), for a filter that draws random numbers.

    most: (n,), the deviations beyond which what it states makes no sense; None where that is not looked at.
    """
    filter = runner.filter
    start = begun(runner, lanes, keys)
    span = runner.step * runner.steps

    def moved(state: Any, t: Any) -> Any:
        return over_lanes(lambda state: filter.integrate(state, t, runner.step, runner.steps))(state)

    def segment(number: Any, carried: Carried) -> Carried:
        if schedule.continuous:
            return held(number, carried)
        carried = carried._replace(state=moved(carried.state, number * span))
        if schedule.measured_every == 0:
            return carried
        if schedule.measured_every == 1:
            return measure(number, carried)
        due = (number + 1) % schedule.measured_every == 0
        return jax.lax.cond(due, measure, lambda _, carried: carried, number, carried)

    def measure(number: Any, carried: Carried) -> Carried:
        y = measurements[(number + 1) // schedule.measured_every - 1]
        return updated(filter, carried, (number + 1) * span, y, most)

    def held(number: Any, carried: Carried) -> Carried:
        """A step under the measurement at its start: a filter's update is the step, a reference must still move."""
        t = number * span
        carried = updated(filter, carried, t, measurements[number], most)
        if filter.system.measurement == "discrete":
            carried = carried._replace(state=moved(carried.state, t))
        return carried

    def to_output(carried: Carried, output: Any) -> tuple[Carried, Any]:
        first = output * schedule.output_every
        if schedule.output_every == 1:
            carried = segment(first, carried)
        else:
            carried = jax.lax.fori_loop(first, first + schedule.output_every, segment, carried)
        return counted_anew(carried), (emitted(filter, carried.state), carried.senseless, carried.scores)

    unmarked = jnp.zeros(lanes, bool)
    carried = Carried(start, jnp.zeros(lanes, int), unmarked, nothing(lanes) if scores else None)
    end, (outputs, senseless, found) = jax.lax.scan(to_output, carried, jnp.arange(schedule.outputs))
    return Followed(
        joined(filter, schedule, start, outputs, end.state),
        end.guarded,
        jnp.full(lanes, schedule.measurements),
        from_start(senseless),
        from_start(found),
    )


def updated(filter: Filter, carried: Carried, t: Any, y: Any, most: Any = None) -> Carried:
    """After the update at the measurements (m, L). most: as for `follow`."""

    def one(state: Any, y: Any) -> tuple[Any, Any, Any, Score | None]:
        senseless = beyond(filter, state, most)
        state, info = filter.update(state, t, y)
        return state, info.guarded, senseless, None if carried.scores is None else score(filter, info)

    state, guarded, senseless, scores = over_lanes(one)(carried.state, y)
    return Carried(
        state, carried.guarded + guarded, carried.senseless | senseless, added(carried.scores, scores)
    )


def beyond(filter: Filter, state: Any, most: Any) -> Any:
    """Decide whether a variance is not finite or beyond the square of `most`, with which an update loses all digits."""
    if most is None:
        return jnp.zeros((), bool)
    P = filter.components(state).cov
    return ~reduce(jnp.logical_and, [jnp.abs(P[i, i]) <= bound**2 for i, bound in enumerate(most)])


def counted_anew(carried: Any) -> Any:
    """After an output, whatever it is that carries the scores."""
    return carried if carried.scores is None else carried._replace(scores=emptied(carried.scores))


def from_start(found: Any) -> Any:
    """What was found (T, L) until each output time, scores or another tree: nothing at the start."""
    return jax.tree.map(lambda part: jnp.concatenate([jnp.zeros_like(part[:1]), part]), found)


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
    # Not inside the vmap, where it would be transposed.
    return jnp.stack([entry for tensor in carried for entry in tensor])


def over_lanes(function: Any) -> Any:
    """A function of one trajectory for a block, with the lanes as the last axis."""
    return jax.vmap(function, in_axes=-1, out_axes=-1)
