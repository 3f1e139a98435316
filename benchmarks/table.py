"""One workload's table: builds the rows, compares their answers, times them, prints, gives lines for JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks import harness, rows, workloads
from benchmarks.harness import Timing
from benchmarks.rows import Row, Unavailable
from benchmarks.workloads import Workload

HEAD = f"{'':44}{'ns/step':>10}{'ratio':>9}{'middle 80 %':>20}{'share':>7}{'compile s':>11}{'differs':>9}"

Builder = Callable[[Workload, np.ndarray], Row]
COMPARISONS = (
    ("nlbench over C, filter alone", rows.THIRD_BY_US, rows.THIRD_IN_C),
    ("nlbench over C, with random numbers and truth", rows.SIMULATED_BY_US, rows.SIMULATED_IN_C),
    ("plain jax over nlbench, filter alone", rows.PLAIN, rows.THIRD_BY_US),
    ("third order over second order, C", rows.THIRD_IN_C, rows.SECOND_IN_C),
    ("third order over second order, nlbench", rows.THIRD_BY_US, rows.SECOND_BY_US),
)


def measure(
    workload: Workload, builders: Sequence[Builder], rounds: int, published: float | None = None
) -> list[dict[str, Any]]:
    """Time the rows; the base is the first that can be built, `differs` compares its last means.

    published: how many times the second-order filter's time Culver's third-order one took.
    """
    built, skipped = build(workload, builders)
    print(f"\n{workload.name}: {workload.says}")
    print(f"{workload.trajectories} trajectories, {workload.times} measurements")
    print(HEAD)
    timings = harness.interleave(built, rounds)
    lines = []
    for timing, means in zip(timings, [*(row.means for row in built), None], strict=True):
        differs = deviation(means, built[0].means, workload)
        print(shown(timing, differs))
        lines.append({"workload": workload.name, **timing._asdict(), "differs": differs})
    for line in skipped:
        print(f"{line['name']:44}  skipped: {line['skipped']}")
    for says, ratio in comparisons(timings):
        beside = f" (Culver 1969: {published:g})" if published and says.startswith("third order") else ""
        print(f"{says}: {ratio:.2f}{beside}")
        lines.append({"workload": workload.name, "comparison": says, "ratio": ratio})
    return lines + skipped


def build(workload: Workload, builders: Sequence[Builder]) -> tuple[list[Row], list[dict[str, Any]]]:
    """The rows that can be built, and lines on those that cannot."""
    y = workloads.measurements(workload)
    built, skipped = [], []
    for builder in builders:
        try:
            built.append(builder(workload, y))
        except Unavailable as reason:
            skipped.append({"workload": workload.name, "name": builder.__name__, "skipped": str(reason)})
    return built, skipped


def shown(timing: Timing, differs: float | None) -> str:
    """A line of the table."""
    return (
        f"{timing.name:44}{timing.nanoseconds:10.2f}{timing.ratio:9.2f}"
        f"{f'{timing.low:.2f} .. {timing.high:.2f}':>20}{timing.share:7.0%}{timing.compile_seconds:11.2f}"
        f"{'' if differs is None else f'{differs:.0e}':>9}"
    )


def comparisons(timings: Sequence[Timing]) -> list[tuple[str, float]]:
    """How many times the second row's time the first one takes, of the rows that there are."""
    named = {timing.name: timing for timing in timings}
    return [
        (says, named[one].over(named[other]))
        for says, one, other in COMPARISONS
        if one in named and other in named
    ]


def deviation(means: np.ndarray | None, base: np.ndarray | None, workload: Workload) -> float | None:
    """Difference of the last means that 99 % of the trajectories do not exceed, in standard deviations at the start;
    None for other data. Where the third-order filter has lost positiveness, no two codes agree."""
    if means is None or base is None:
        return None
    errors = np.max(np.abs(means - base[: len(means)]) / np.sqrt(np.diag(workload.cov)), axis=1)
    return float(np.quantile(np.nan_to_num(errors, nan=np.inf), 0.99, method="inverted_cdf"))
