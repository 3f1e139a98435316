"""The computation of blocks: truth and noise once, every filter along them, sums over the lanes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun

from nlbench.engine.follow import Followed, follow, over_lanes
from nlbench.engine.judge import judge, most_stated
from nlbench.engine.sighting import follow_sightings
from nlbench.simulate import Simulated, Trajectory, seed_key, simulate
from nlbench.statistics.accumulate import block_sums
from nlbench.statistics.share import ALL, Share
from nlbench.statistics.tracks import Tracks

if TYPE_CHECKING:
    from nlbench.engine.problem import Problem, Runner

WORD = 1 << 32


class Chunk(NamedTuple):
    """Blocks to compute in one call: the lanes' trajectories (B, L), how many lanes are real (B,), how many blocks;
    and the one lane of one block that is looked at in full."""

    lanes: Trajectory
    real: Any
    count: Any
    watched_block: Any
    watched_lane: Any


class View(NamedTuple):
    """One trajectory in full: true states (T, n), measurements (M, m), and of each filter the unique components of
    mean, covariance and third moment (T, k), the errors and their estimated variances (T, C), whether diverged (T,),
    and how many updates the guard replaced."""

    truth: Any
    measurements: Any
    components: tuple[Any, ...]
    error: tuple[Any, ...]
    variance: tuple[Any, ...]
    diverged: tuple[Any, ...]
    guarded: tuple[Any, ...]


def make_chunk(
    problem: Problem,
    first_block: int,
    count: int,
    capacity: int,
    runs: int,
    watched: tuple[int, int] = (0, 0),
    share: Share = ALL,
) -> Chunk:
    """Blocks first_block ... first_block + count - 1 of `runs` runs, in arrays that hold `capacity` blocks.

    watched: a block, counted from first_block, and a lane of it. share: whose blocks are counted.
    """
    L = problem.block
    blocks = share.blocks(first_block, capacity)
    numbers = blocks[:, None] * np.uint64(L) + np.arange(L, dtype=np.uint64)
    firsts = numbers - numbers % np.uint64(problem.set_size)
    lanes = Trajectory(*words(numbers), *words(firsts), (numbers - firsts).astype(np.int32))
    real = [min(max(runs - int(block) * L, 0), L) for block in blocks]
    return Chunk(lanes, np.array(real, np.int32), np.int32(count), *map(np.int32, watched))


def words(numbers: Any) -> tuple[Any, Any]:
    """64-bit numbers as their high and low 32 bits."""
    numbers = np.asarray(numbers, np.uint64)
    return (numbers // np.uint64(WORD)).astype(np.uint32), (numbers % np.uint64(WORD)).astype(np.uint32)


def chunk_sums(problem: Problem, seed: tuple[Any, Any], chunk: Chunk) -> tuple[dict[str, Any], View]:
    """The sums of each block of a chunk, stacked along a leading axis, entries past `count` zero; the watched lane."""

    def one(number: Any) -> tuple[dict[str, Any], View]:
        lanes = jax.tree.map(lambda words: words[number], chunk.lanes)
        mask = jnp.arange(problem.block) < chunk.real[number]
        tracks, view = block_tracks(problem, seed, lanes, chunk.watched_lane)
        return block_sums(tracks, mask, problem.layout), view

    traced, (sums, view) = jax.make_jaxpr(one, return_shape=True)(np.int32(0))
    traced_once = jaxpr_as_fun(traced)
    structure = jax.tree.structure((sums, view))

    def step(number: Any, carry: tuple[dict[str, Any], View]) -> tuple[dict[str, Any], View]:
        sums, view = jax.tree.unflatten(structure, traced_once(number))
        watched = number == chunk.watched_block
        return (
            jax.tree.map(lambda total, part: total.at[number].set(part), carry[0], sums),
            jax.tree.map(lambda before, now: jnp.where(watched, now, before), carry[1], view),
        )

    capacity = chunk.real.shape[0]
    empty = jax.tree.map(lambda leaf: jnp.zeros((capacity, *leaf.shape), leaf.dtype), sums)
    unseen = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), view)
    return jax.lax.fori_loop(0, chunk.count, step, (empty, unseen))


def block_tracks(
    problem: Problem, seed: tuple[Any, Any], lanes: Trajectory, lane: Any
) -> tuple[Tracks, View]:
    """What the filters did on one block, and one lane of it."""
    data = trajectories(problem, seed, lanes)
    states, layout = data.states[:: problem.schedule.output_every], problem.layout
    scored = problem.layout.scores and bool(problem.schedule.sightings or problem.schedule.measurements)
    moments = [followed(problem, runner, data, scored) for runner in problem.runners]
    judged = [
        judge(problem.judged_by, runner.filter.system, layout, states, each.components, each.senseless)
        for runner, each in zip(problem.runners, moments, strict=True)
    ]
    reports = np.asarray(layout.reports)
    coordinates = range(len(layout.coordinates))
    squares = np.array([layout.components(2).index((i, i)) for i in coordinates])
    cubes = np.array([layout.components(3).index((i, i, i)) for i in coordinates])
    tracks = Tracks(
        error=jnp.stack([each.error for each in judged]),
        variance=jnp.stack([each.cov[:, squares] for each in judged]),
        third=jnp.stack([each.third[:, cubes] for each in judged]),
        nees=jnp.stack([each.nees for each in judged]),
        cov=jnp.stack([each.cov[reports] for each in judged]),
        cross_third=jnp.stack([each.third[reports] for each in judged]),
        diverged=jnp.stack([each.diverged for each in judged]),
        guarded=jnp.stack([each.guarded for each in moments]),
        updates=jnp.stack([each.updates for each in moments]),
        scores=jax.tree.map(lambda *each: jnp.stack(each), *(each.scores for each in moments)),
    )
    view = View(
        states,
        data.measurements,
        tuple(each.components for each in moments),
        tuple(each.error for each in judged),
        tuple(each.cov[:, squares] for each in judged),
        tuple(each.diverged for each in judged),
        tuple(each.guarded for each in moments),
    )
    return tracks, jax.tree.map(lambda leaf: leaf[..., lane], view)


def trajectories(problem: Problem, seed: tuple[Any, Any], lanes: Trajectory) -> Simulated:
    """Truth and measurements of a block, the lanes last."""
    key = seed_key(*seed)
    return over_lanes(lambda trajectory: simulate(problem.truth, problem.schedule, key, trajectory))(lanes)


def followed(problem: Problem, runner: Runner, data: Simulated, scores: bool = False) -> Followed:
    """One filter along the data of a block, scored by its measurements if that is asked for."""
    most = most_stated(problem.layout, runner)
    if problem.schedule.sightings:
        return follow_sightings(problem, runner, data, scores, most)
    return follow(runner, problem.schedule, data.measurements, problem.block, data.key, scores, most)
