"""How much faster two local dask workers are than one: `python -m benchmarks.cluster [RUNS] [ROUNDS]`.

Both clusters stay open and compute the same blocks in turn, so that noise meets both. First the calls alone, with the
program compiled; then whole runs, which start processes, compile (from the cache after the first) and write. The figure
is the median of the rounds' ratios. It needs a machine with two idle cores.
"""

from __future__ import annotations

import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median

from nlbench import config, engine, runtime

CONFIG = Path(__file__).parents[1] / "configs" / "quickstart.yaml"


def main() -> None:
    """Print both ratios."""
    runs, rounds = (int(float(text)) for text in (sys.argv[1:] + ["400000", "5"][len(sys.argv) - 1 :]))
    experiment = config.load(CONFIG, [config.Override("monte_carlo.runs", str(runs), "runs")])
    runtime.configure(precision=experiment.engine.precision)
    report("calls alone", calls(experiment, runs, rounds))
    report("whole runs", [[whole(experiment, number) for number in (1, 2)] for _ in range(rounds)])


def report(name: str, seconds: list[list[float]]) -> None:
    """The median ratio of one worker's time to two workers', and all rounds."""
    ratios = [one / two for one, two in seconds]
    print(f"{name}: {median(ratios):.2f} times faster ({', '.join(f'{ratio:.2f}' for ratio in ratios)})")


def calls(experiment: config.Experiment, runs: int, rounds: int) -> list[list[float]]:
    """Seconds of all blocks with one worker and with two, each round."""
    from nlbench.engine.cluster import Dask, opening
    from nlbench.engine.compiled import CAPACITY, compile_chunks
    from nlbench.engine.problem import make
    from nlbench.engine.remote import Task
    from nlbench.engine.resume import numerics
    from nlbench.engine.workers import in_order

    compiled = compile_chunks(make(experiment), experiment.monte_carlo.seed)
    task = Task(experiment.resolved_yaml(), runs, tuple(numerics(compiled).items()))
    blocks = runs // experiment.engine.block
    seconds = []
    with ExitStack() as stack:
        opened = [stack.enter_context(opening(f"local:{number}")) for number in (1, 2)]
        arms = [stack.enter_context(Dask(each.result().client, task)) for each in opened]
        for turn in range(rounds + 1):  # the first is for compiling
            seconds.append([])
            for workers in arms:
                begun = time.perf_counter()
                for _ in in_order(workers, 0, blocks, CAPACITY, lambda: False):
                    pass
                seconds[turn].append(time.perf_counter() - begun)
    return seconds[1:]


def whole(experiment: config.Experiment, number: int) -> float:
    """Seconds of a run from nothing with that many workers."""
    from nlbench.engine.compiled import forget_programs

    forget_programs()
    with tempfile.TemporaryDirectory() as out:
        begun = time.perf_counter()
        engine.run(experiment, out, dask=f"local:{number}")
        return time.perf_counter() - begun


if __name__ == "__main__":
    main()
