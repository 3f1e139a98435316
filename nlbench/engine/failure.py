"""When and in what a filter that failed first went wrong: its first block once more, looked at after every part."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench.engine.block import followed, make_chunk, trajectories, words
from nlbench.engine.follow import beyond
from nlbench.engine.judge import judge, most_stated
from nlbench.moments.moments import Components
from nlbench.results.reasons import COLUMNS, not_finite

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from nlbench.engine.problem import Problem, Runner
    from nlbench.filters.filter import Filter

PARTS = ("start", "propagation", "update")
MOMENTS = ("mean", "covariance", "third moment")
SENSELESS = 1 << len(MOMENTS)
FINE = (0.0, 0.0, 0.0)  # a mark: when, in which of `PARTS`, and the bits of what was wrong
UNSUMMED = "its errors or moments are too large to be summed"


def failures(problem: Problem, seed: int, runs: int, labels: Sequence[str]) -> pd.DataFrame:
    """`filter, run, time, part, what` of these filters: the run of the first block that was lost first, and how.

    part: `start`, `propagation` (then time is its end) or `update`; empty where an error passed the system's bound.
    run: -1 where no run of the block says it.
    """
    import pandas as pd

    lanes = jax.tree.map(lambda part: part[0], make_chunk(problem, 0, 1, 1, runs).lanes)
    data = jax.jit(partial(trajectories, problem, words(seed)))(lanes)
    chosen = [runner for runner in problem.runners if runner.label in labels]
    rows = [(runner.label, *_first(problem, runner, data, min(runs, problem.block))) for runner in chosen]
    return pd.DataFrame(rows, columns=COLUMNS)


def _first(problem: Problem, runner: Runner, data: Any, runs: int) -> tuple[int, float, str, str]:
    """The run that was lost first: its number, when, in which part, what."""
    marks, diverged = (np.asarray(part) for part in jax.jit(partial(_marked, problem, runner))(data))
    times = np.append(problem.layout.times, np.inf)
    lost = times[np.where(diverged.any(0), diverged.argmax(0), -1)][:runs]
    when, part, what = marks[:, :runs]
    marked = (what > 0) & (when <= lost + 1e-9)
    first = np.where(marked, when, lost)
    run = int(first.argmin())
    if not np.isfinite(first[run]):
        return -1, np.nan, "", UNSUMMED
    if not marked[run]:
        return run, float(first[run]), "", "its error is beyond the system's bound"
    return run, float(first[run]), PARTS[int(part[run])], _words(int(what[run]))


def _words(bits: int) -> str:
    if bits == SENSELESS:
        return "the covariance is beyond all sense"
    return not_finite([name for place, name in enumerate(MOMENTS) if bits >> place & 1])


def _marked(problem: Problem, runner: Runner, data: Any) -> tuple[Any, Any]:
    """The first mark of each run (3, L), and whether it had diverged at the output times (T, L)."""
    filter, layout = runner.filter, problem.layout
    watched = (
        runner if filter.history else runner._replace(filter=_watched(filter, most_stated(layout, runner)))
    )
    found = followed(problem, watched, data)
    components, marks = found.components, jnp.zeros((len(FINE), problem.block))
    if watched is not runner:
        components, marks = components[:, : -len(FINE)], components[-1, -len(FINE) :]
    states = data.states[:: problem.schedule.output_every]
    judged = judge(problem.judged_by, filter.system, layout, states, components, found.senseless)
    return marks, judged.diverged


def _watched(filter: Filter, most: Any) -> Filter:
    """The filter with a mark beside its state, which it shows after its last moments."""
    angle = filter.angle

    def marked(state: Any, mark: Any, t: Any, part: str) -> tuple[Any, Any]:
        carried = [tensor for tensor in filter.components(state)[: len(MOMENTS)] if tensor is not None]
        bad = [~jnp.isfinite(jnp.stack([jnp.asarray(entry) for entry in each])).all() for each in carried]
        bits = sum(each * float(1 << place) for place, each in enumerate(bad))
        bits = jnp.where(bits > 0, bits, SENSELESS * beyond(filter, state, most))
        now = jnp.stack([jnp.asarray(each, float) for each in (t, PARTS.index(part), bits)])
        return state, jnp.where((mark[2] == 0) & (bits > 0), now, mark)

    def update(pair: Any, t: Any, y: Any, **more: Any) -> Any:
        state, info = filter.update(pair[0], t, y, **more)
        return marked(state, pair[1], t, "update"), info

    def components(pair: Any) -> Components:
        mean, cov, third = filter.components(pair[0])[:3]
        after: Any = [*(third or ()), *pair[1]]
        return Components(mean, cov, after)

    return filter._replace(
        init=lambda *given: marked(filter.init(*given), jnp.asarray(FINE), 0.0, "start"),
        integrate=lambda pair, t, h, count: marked(
            filter.integrate(pair[0], t, h, count), pair[1], t + h * count, "propagation"
        ),
        update=update,
        components=components,
        angle=None if angle is None else lambda pair: angle(pair[0]),
    )
