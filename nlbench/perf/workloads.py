"""What is timed: filters alone on given measurements, and the block computation of a small experiment."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.errors import ConfigError
from nlbench.perf.counts import counted

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.engine.problem import Problem, Runner

BLOCKS = 10
SEED = 1969
_COMPILED = "/jax/core/compile/backend_compile_duration"
_compilations: list[float] = []
SCALAR: dict[str, Any] = {
    "experiment": "culver-scalar",
    "system": {"name": "culver-scalar", "ensemble": "matched", "interval": 0.1, "measurement_variance": 1.6},
    "filters": ["ekf", "third-order-guarded"],
    "time": {"end": 2.0, "step": 0.02, "output": 0.1},
    "monte_carlo": {"runs": 1000, "seed": SEED},
}
OSCILLATOR: dict[str, Any] = {
    "experiment": "oscillator",
    "system": {"name": "oscillator"},
    "filters": ["ekf", "third-order-guarded"],
    "time": {"end": 4.0, "step": 0.05, "output": 0.2},
    "monte_carlo": {"runs": 1000, "seed": SEED},
}
GROWTH: dict[str, Any] = {
    "experiment": "ungm",
    "system": {"name": "ungm"},
    "filters": ["ukf"],
    "time": {"end": 50, "output": 1},
    "monte_carlo": {"runs": 1000, "seed": SEED},
}


class Workload(NamedTuple):
    """A compiled program with its data, its counts, and what identifies the experiment behind it, if there is one.

    call: (times) computes all of it so many times. Filters do in one call of the program: of cheap ones a call takes
    longer than what it computes, and that would hide how slow they are.
    """

    name: str
    call: Callable[[int], object]
    counts: dict[str, float]
    experiment: str = ""


def standard() -> list[Workload]:
    """The project's own: two continuous problems, one in discrete time, one whole experiment."""
    from nlbench import config

    experiments = [config.from_dict(each) for each in (SCALAR, OSCILLATOR, GROWTH)]
    return [*of_experiments(experiments), whole(experiments[0])]


def of_experiments(experiments: Sequence[Experiment]) -> list[Workload]:
    """Each filter of each experiment; references are left out.

    Raises `ConfigError` where two have one name, by which baselines know them.
    """
    names = [each.experiment for each in experiments]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(
            f"perf: several files have the experiment {', '.join(twice)}; give each a name of its own"
        )
    return [each for experiment in experiments for each in _filters(experiment)]


def _filters(experiment: Experiment) -> list[Workload]:
    import jax

    from nlbench.engine import block, problem

    stated = problem.make(experiment)
    chunk = block.make_chunk(stated, 0, BLOCKS, BLOCKS, BLOCKS * stated.block)
    simulated = partial(block.trajectories, stated, block.words(SEED))
    data = jax.block_until_ready(jax.jit(lambda lanes: jax.lax.map(simulated, lanes))(chunk.lanes))
    runners = stated.runners[: len(experiment.filters)]
    found = [alone(f"{experiment.experiment} {each.label}", stated, each, data) for each in runners]
    return [each._replace(experiment=experiment.hash12()) for each in found]


def alone(name: str, problem: Problem, runner: Runner, data: Any) -> Workload:
    """One filter on the data of all blocks."""
    import numpy as np

    from nlbench.engine import cost

    traced, runner = _watched(runner)
    program, counts = compiled(partial(cost.alone, problem, runner), (data, np.int32(1)), traced)
    return Workload(name, lambda times: _ended(program(data, np.int32(times * BLOCKS))), counts)


def whole(experiment: Experiment) -> Workload:
    """All that a run computes: random numbers, truth, filters, statistics."""
    import jax

    from nlbench.engine import block, problem

    stated = problem.make(experiment)
    watched = [_watched(each) for each in stated.runners]
    stated = stated._replace(runners=tuple(runner for _, runner in watched))
    chunk = block.make_chunk(stated, 0, BLOCKS, BLOCKS, BLOCKS * stated.block)
    traced = lambda: sum(each() for each, _ in watched)  # noqa: E731
    arguments = _ended(jax.device_put((block.words(SEED), chunk)))
    program, counts = compiled(partial(block.chunk_sums, stated), arguments, traced)

    def call(times: int) -> None:
        for _ in range(times):
            _ended(program(*arguments))

    return Workload(f"{experiment.experiment} whole run", call, counts)


def compiled(
    work: Callable, arguments: tuple, traced: Callable[[], int] = lambda: 1
) -> tuple[Callable, dict[str, float]]:
    """The program of a function for such arguments, and its counts; `traced` says how often its parts were traced."""
    import jax

    _listen()
    before = len(_compilations)
    program = jax.jit(work).lower(*arguments).compile()
    _ended(program(*arguments))
    return program, counted(program, len(_compilations) - before, traced())


def _ended(result: Any) -> Any:
    import jax

    return jax.block_until_ready(result)


def _watched(runner: Runner) -> tuple[Callable[[], int], Runner]:
    """The runner, and how often its filter's update was traced since."""
    calls: list[None] = []
    update = runner.filter.update

    def counting(*arguments: Any, **options: Any) -> Any:
        calls.append(None)
        return update(*arguments, **options)

    return lambda: len(calls), runner._replace(filter=runner.filter._replace(update=counting))


def _listen() -> None:
    """Count compilations from now on."""
    import jax

    def heard(event: str, duration_secs: float, **_: str | int) -> None:
        if event == _COMPILED:
            _compilations.append(duration_secs)

    if not _listening:
        _listening.append(True)
        jax.monitoring.register_event_duration_secs_listener(heard)


_listening: list[bool] = []
