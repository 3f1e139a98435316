"""One filter over one block, with measurements that wait for an angle: each lane makes its own at its own step.

The block is carried step by step until some lane's sighting is due, or an output; only then is the update computed,
for all lanes, and kept in the lanes where it was due.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp

from nlbench.engine.follow import (
    Followed,
    begun,
    beyond,
    counted_anew,
    emitted,
    from_start,
    joined,
    over_lanes,
)
from nlbench.engine.scores import Score, added, nothing, score
from nlbench.orbit import wrapped
from nlbench.statistics.tracks import Scores

if TYPE_CHECKING:
    from nlbench.engine.problem import Problem, Runner
    from nlbench.simulate import Simulated


class Progress(NamedTuple):
    """Of a block: steps made; the filter's state; per lane the angle followed so far, whether a sighting is due, how
    many were made, in how many the guard replaced the update, and the scores since the last output."""

    step: Any
    state: Any
    angle: Any
    due: Any
    made: Any
    guarded: Any
    senseless: Any
    scores: Scores | None


def follow_sightings(
    problem: Problem, runner: Runner, data: Simulated, scores: bool = False, most: Any = None
) -> Followed:
    """The filter along the truth (steps + 1, n, L) of a block, whose sightings have the noise (K, m, L).

    most: as for `follow`.
    """
    schedule, lanes, filter = problem.schedule, problem.block, runner.filter
    truth, seen_angle = getattr(problem.truth, "sightings", None), filter.angle
    if truth is None or seen_angle is None:
        raise ValueError("a schedule with sightings needs systems that say what they are")

    def advanced(before: Progress) -> Progress:
        t = before.step * schedule.step
        state = over_lanes(lambda state: filter.integrate(state, t, runner.step, runner.steps))(before.state)
        step = before.step + 1
        if problem.nominal_steps:
            due = step >= jnp.asarray(problem.nominal_steps)[jnp.minimum(before.made, schedule.sightings - 1)]
            angle = before.angle
        else:
            now = over_lanes(seen_angle)(state)
            angle = before.angle + wrapped(now - before.angle)
            due = angle >= truth.due(before.made)
        return before._replace(
            step=step, state=state, angle=angle, due=due & (before.made < schedule.sightings)
        )

    def measured(before: Progress) -> Progress:
        t, x = before.step * schedule.step, data.states[before.step]
        number = jnp.minimum(before.made, schedule.sightings - 1)
        noise = jnp.take_along_axis(data.noise, number[None, None], axis=0)[0]
        y = over_lanes(lambda number, x, noise: truth.observe(truth.mark(number), x) + noise)(
            number, x, noise
        )

        def one(state: Any, y: Any, number: Any) -> tuple[Any, Any, Any, Score | None]:
            senseless = beyond(filter, state, most)
            state, info = filter.update(state, t, y, sighting=number)
            return state, info.guarded, senseless, score(filter, info) if scores else None

        updated, guarded, senseless, gained = over_lanes(one)(before.state, y, number)
        due = before.due
        return before._replace(
            state=jax.tree.map(lambda new, old: jnp.where(due, new, old), updated, before.state),
            due=jnp.zeros_like(due),
            made=before.made + due,
            guarded=before.guarded + (guarded & due),
            senseless=before.senseless | (senseless & due),
            scores=added(before.scores, gained, due),
        )

    def to_output(before: Progress, output: Any) -> tuple[Progress, Any]:
        last = (output + 1) * schedule.output_every

        def leg(before: Progress) -> Progress:
            waiting = lambda now: (now.step < last) & ~jnp.any(now.due)  # noqa: E731
            now = jax.lax.while_loop(waiting, advanced, before)
            return jax.lax.cond(jnp.any(now.due), measured, lambda now: now, now)

        after = jax.lax.while_loop(lambda now: now.step < last, leg, before)
        return counted_anew(after), (emitted(filter, after.state), after.senseless, after.scores)

    state = begun(runner, lanes, data.key)
    none = jnp.zeros(lanes, int)
    start = Progress(
        step=jnp.asarray(0),
        state=state,
        angle=jnp.zeros(lanes),
        due=jnp.zeros(lanes, bool),
        made=none,
        guarded=none,
        senseless=jnp.zeros(lanes, bool),
        scores=nothing(lanes) if scores else None,
    )
    end, (outputs, senseless, found) = jax.lax.scan(to_output, start, jnp.arange(schedule.outputs))
    components = joined(filter, schedule, state, outputs, end.state)
    return Followed(components, end.guarded, end.made, from_start(senseless), from_start(found))
