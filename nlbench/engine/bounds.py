"""The posterior Cramer-Rao bound of an experiment, its expectations taken over the experiment's own first runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from nlbench import schedule
from nlbench.engine.block import make_chunk, words
from nlbench.errors import ConfigError
from nlbench.simulate import path, seed_key, simulate
from nlbench.statistics.cramer_rao import Transition, carried, gained, moved
from nlbench.systems.discrete import DiscreteSystem

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.engine.problem import Problem
    from nlbench.schedule import Schedule
    from nlbench.simulate import Trajectory

RUNS = 1000  # at least so many; whole blocks
SAME = 1e-9  # relative difference that rounding can make


def bounds_table(problem: Problem, seed: int) -> pd.DataFrame:
    """`time, coordinate, statistic, value, n`: `pcrb`, the square root of the bound, which no RMS error is below.

    n: runs that the expectations are over. A true state that is not finite makes what follows NaN. Raises
    `ConfigError`, saying why, where the system has no bound of this kind.
    """
    import pandas as pd

    _refuse(problem)
    count = -(-RUNS // problem.block)
    of_block = _discrete if isinstance(problem.truth, DiscreteSystem) else _continuous
    covs = np.array(of_block(problem, seed, count))
    layout = problem.layout
    squares = [covs[:, i, i] for i in range(len(layout.coordinates))]
    squares += [np.sum([squares[i] for i in members], axis=0) for members in layout.norms.values()]
    rows = [
        (time, name, "pcrb", float(np.sqrt(square[place])), count * problem.block)
        for place, time in enumerate(layout.times)
        for name, square in zip(layout.magnitudes, squares, strict=True)
    ]
    return pd.DataFrame(rows, columns=["time", "coordinate", "statistic", "value", "n"])


def _refuse(problem: Problem) -> None:
    truth = problem.truth
    why = {
        "errors are not differences of states": problem.judged_by.error is not None,
        "initial states are not normal": truth.sample is not None,
    }
    if not isinstance(truth, DiscreteSystem):
        why |= {
            "measurements are continuous": truth.measurement == "continuous",
            "measurements wait for an angle": truth.sightings is not None,
            "there is process noise in continuous time": truth.diffusion is not None,
        }
    reasons = [reason for reason, holds in why.items() if holds]
    if reasons:
        raise _refusal(", and ".join(reasons))


def _refusal(reason: str) -> ConfigError:
    return ConfigError(f"bounds: there is no Cramer-Rao bound here, since {reason}; leave `bounds` out")


def _summed(problem: Problem, seed: int, count: int, of_run: Any) -> Any:
    """Means of what each run gives, over whole blocks, added in their order."""
    chunk = make_chunk(problem, 0, count, count, count * problem.block)
    key = seed_key(*words(seed))
    block = jax.jit(
        lambda key, lanes: jax.tree.map(
            lambda part: part.sum(0), jax.vmap(lambda run: of_run(key, run))(lanes)
        )
    )
    total: Any = None
    for number in range(count):
        sums = block(key, jax.tree.map(lambda part, at=number: part[at], chunk.lanes))
        part = jax.tree.map(lambda leaf: np.asarray(leaf, float), sums)
        total = part if total is None else jax.tree.map(np.add, total, part)
    return jax.tree.map(lambda leaf: leaf / (count * problem.block), total)


def _discrete(problem: Problem, seed: int, count: int) -> list[np.ndarray]:
    """The bound at the output times, by the recursion of `statistics.cramer_rao`, (1) and (2)."""
    truth = problem.truth
    assert isinstance(truth, DiscreteSystem)
    end, every = round(problem.layout.times[-1]), truth.interval
    steps = schedule.make(end, 1, 1, every)
    Q, R = _noises(truth, steps, seed, problem)
    inverse = np.linalg.pinv(Q, hermitian=True)  # (K, n, n)
    off = np.eye(truth.states) - Q @ inverse
    weight = np.linalg.inv(R) if steps.measurements else np.zeros((0, 1, 1))

    def of_run(key: Any, run: Trajectory) -> Any:
        states = simulate(truth, steps, key, run).states
        F = _jacobians(
            lambda k, x: truth.transition_with_inputs(k, x, jnp.zeros(len(truth.process_cov))), states[:-1]
        )
        seen = states[every::every] if steps.measurements else states[:0]
        at = jnp.arange(1, len(seen) + 1) * (every or 1)
        H = _jacobians(
            lambda k, x: truth.observe_with_noise(k, x, jnp.zeros(len(truth.measurement_cov))), seen, at
        )
        return (
            F,
            jnp.einsum("kai,kab,kbj->kij", F, inverse, F),
            jnp.sum((off @ F) ** 2, axis=(1, 2)),
            jnp.einsum("kai,kab,kbj->kij", H, weight, H),
        )

    F, information, outside, learned = _summed(problem, seed, count, of_run)
    P = np.asarray(truth.initial.cov, float)
    track = [P]
    for k in range(end):
        try:
            P = moved(P, Transition(F[k], information[k], float(outside[k]), Q[k]))
        except ValueError as fault:
            raise _refusal(str(fault)) from fault
        if every and (k + 1) % every == 0:
            P = gained(P, learned[(k + 1) // every - 1])
        track.append(P)
    return [track[round(time)] for time in problem.layout.times]


def _noises(
    truth: DiscreteSystem, steps: Schedule, seed: int, problem: Problem
) -> tuple[np.ndarray, np.ndarray]:
    """Q (K, n, n) and R (M, m, m), which must be the same for all states: the noise enters by itself."""
    lanes = jax.tree.map(lambda part: part[0, :2], make_chunk(problem, 0, 1, 1, problem.block).lanes)
    key = seed_key(*words(seed))
    states = jax.jit(jax.vmap(lambda run: simulate(truth, steps, key, run).states))(lanes)
    numbers = jnp.arange(1, steps.measurements + 1) * (truth.interval or 1)
    given = (
        (
            "process",
            truth.transition_with_inputs,
            truth.process_cov,
            states[:, :-1],
            jnp.arange(steps.segments),
        ),
        ("measurement", truth.observe_with_noise, truth.measurement_cov, states[:, numbers], numbers),
    )
    found = []
    for what, function, cov, where, at in given:
        s = len(cov)

        def entering(k: Any, x: Any, scale: float, function: Any = function, s: int = s) -> Any:
            full = lambda w: _array(function(k, x, w))  # noqa: E731
            return jax.jacfwd(full)(jnp.full(s, scale))

        each = jax.vmap(jax.vmap(entering, (0, 0, None)), (None, 0, None))
        G = np.concatenate([np.asarray(each(at, where, scale)) for scale in (0.0, 1.0)])
        if G.size and not np.allclose(G, G[:1], rtol=SAME, atol=SAME * np.abs(G).max()):
            raise _refusal(f"the {what} noise depends on the state, or does not enter linearly")
        found.append(G[0] @ np.asarray(cov, float) @ np.swapaxes(G[0], 1, 2))
    Q, R = found
    if R.size and np.linalg.matrix_rank(R).min() < R.shape[1]:
        raise _refusal("something is measured without noise")
    return Q, R


def _continuous(problem: Problem, seed: int, count: int) -> list[np.ndarray]:
    """The bound at the output times, from the information on the initial state: (3) of `statistics.cramer_rao`."""
    truth: Any = problem.truth
    times = problem.schedule
    weight = np.linalg.inv(np.asarray(truth.measurement_cov, float))
    measured = np.arange(1, times.measurements + 1) * times.measured_every
    seen_at = jnp.asarray(times.measurement_times)

    def of_run(key: Any, run: Trajectory) -> Any:
        states = simulate(truth, times, key, run).states
        flow = jax.jacfwd(lambda start: path(truth, times, None, start))(states[0])
        H = _jacobians(truth.observe, states[measured], seen_at) @ flow[measured - 1]
        return flow[times.output_every - 1 :: times.output_every], jnp.einsum("kai,ab,kbj->kij", H, weight, H)

    flow, learned = _summed(problem, seed, count, of_run)
    P0 = np.asarray(truth.initial.cov, float)
    so_far = np.cumsum(np.concatenate([np.zeros((1, *P0.shape)), learned]), axis=0)
    track = [P0]
    for output, Phi in enumerate(flow, start=1):
        number = output * times.output_every // times.measured_every if times.measured_every else 0
        track.append(carried(P0, so_far[number], Phi))
    return track


def _jacobians(function: Any, states: Any, at: Any = None) -> Any:
    """d function(t, x)/dx, (K, r, n), at the states (K, n) and times (K,); by default at steps 0, 1, ..."""
    at = jnp.arange(len(states)) if at is None else at
    return jax.vmap(lambda t, x: jax.jacfwd(lambda x: _array(function(t, x)))(x))(at, states)


def _array(y: Any) -> Any:
    return jnp.stack([jnp.asarray(part) for part in y]) if isinstance(y, (tuple, list)) else jnp.asarray(y)
