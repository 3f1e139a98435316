"""Seconds of each part of the command `run`, from what was measured of it; they add up to what the user waits."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from nlbench.engine import cost
from nlbench.engine.resume import CHECKPOINT_SHARE, SECONDS_BETWEEN_CHECKPOINTS

if TYPE_CHECKING:
    from nlbench.engine.planning.calibration import Calibration
    from nlbench.engine.planning.compilation import Compilation
    from nlbench.engine.problem import Problem

# Seconds on the machine for which `machine.REFERENCE` stands, one core of it undisturbed.
IMPORTS = 1.5
PICTURES_ONCE, PICTURE, PICTURE_OF_FILTER = 0.9, 0.2, 0.03
RUN_KEPT = 6e-7  # of one filter at one time
CLAIM = 0.03
SAVED_BYTES = 150e6  # of a checkpoint in a second
# The filters alone against the whole program, in time of the processor: the truth and the statistics are not compiled
# again, the loops around each filter are. Between .5 and .95 on the experiments of this repository.
ALONE = 0.75


class Work(NamedTuple):
    """What is to be done: blocks; values kept, each of a run, filter and report time; bytes of a checkpoint; pictures;
    claims; and whether the tables are there already."""

    blocks: int
    kept: int
    state: int
    pictures: int
    claims: int
    finished: bool


class Measured(NamedTuple):
    """What was measured here: seconds to state the problem, of bounds, of tables and to count operations; each filter's
    share of the operations; how much slower than on the reference machine Python runs; the program's compilation; the
    calibration."""

    problem: float
    bounds: float
    tables: float
    counting: float
    shares: tuple[float, ...]
    slowness: float
    compilation: Compilation
    calibration: Calibration


def durations(problem: Problem, work: Work, measured: Measured, threads: int) -> dict[str, float]:
    """Seconds by part, in the order in which they pass."""
    slow = measured.slowness / measured.calibration.share
    figures = PICTURES_ONCE + work.pictures * (PICTURE + PICTURE_OF_FILTER * len(problem.runners))
    parts = {"start": IMPORTS * slow + measured.problem, "figures_and_report": figures * slow}
    if work.finished:
        return parts
    computing = work.blocks * measured.calibration.seconds_per_block
    saving = work.state / SAVED_BYTES * slow
    checkpoints = min(computing / CHECKPOINT_SHARE, computing / SECONDS_BETWEEN_CHECKPOINTS * saving) + saving
    tables = measured.tables + (RUN_KEPT * work.kept + CLAIM * work.claims) * slow
    return {
        "start": parts["start"],
        "compile": measured.compilation.again,
        "bounds": measured.bounds,
        "run": computing + checkpoints,
        "cost_table": _cost_table(problem, measured, threads),
        "tables": tables,
        "figures_and_report": parts["figures_and_report"],
    }


def _cost_table(problem: Problem, measured: Measured, threads: int) -> float:
    """Each filter is compiled alone, as many at a time as there are threads, and timed; operations are counted."""
    compilation, share = measured.compilation, measured.calibration.share
    alone = ALONE * (compilation.trace + compilation.compile / min(threads, len(problem.runners)))
    block = measured.calibration.seconds_per_block * threads * share  # one thread by itself, all filters
    timed = sum(_timing(problem, block * part) for part in measured.shares)
    return alone + timed / share + measured.counting


def _timing(problem: Problem, block: float) -> float:
    """Seconds to time a filter that takes so long for a block."""
    count = max(1, min(_blocks_timed(problem), int(cost.PASS_SECONDS / block)))
    rounds = min(cost.ROUNDS, int(cost.FILTER_SECONDS / (block * count)))
    return block * (2 + rounds * (count + 1))


def _blocks_timed(problem: Problem) -> int:
    schedule = problem.schedule
    steps = schedule.segments * schedule.segment_steps * problem.block
    return max(1, min(cost.MOST_BLOCKS, cost.MOST_STEPS // steps))


def shares(problem: Problem, counted: list[tuple[int, int]]) -> tuple[float, ...]:
    """Each filter's part of all operations of a run, from those of one step and of one update."""
    schedule = problem.schedule
    steps, updates = schedule.segments * schedule.segment_steps, schedule.measurements or schedule.sightings
    whole = [step * steps + update * updates + 1 for step, update in counted]  # 1: a filter may do nothing
    return tuple(each / sum(whole) for each in whole)
