"""One workload's table: builds the rows, compares their answers, times them, prints, gives lines for JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks import harness, workloads
from benchmarks.rows import Row, Unavailable
from benchmarks.workloads import Workload

HEAD = f"{'':44}{'ns/step':>10}{'ratio':>9}{'middle 80 %':>20}{'share':>7}{'compile s':>11}{'differs':>9}"


def measure(
    workload: Workload, builders: Sequence[Callable[[Workload, np.ndarray], Row]], rounds: int
) -> list[dict[str, Any]]:
    """Time the rows; the base is the first that can be built, `differs` compares its last means."""
    y = workloads.measurements(workload)
    rows, skipped = [], []
    for builder in builders:
        try:
            rows.append(builder(workload, y))
        except Unavailable as reason:
            skipped.append({"workload": workload.name, "name": builder.__name__, "skipped": str(reason)})
    print(f"\n{workload.name}: {workload.says}")
    print(f"{workload.trajectories} trajectories, {workload.times} measurements")
    print(HEAD)
    lines = []
    answers = [row.means for row in rows] + [None]
    for timing, means in zip(harness.interleave(rows, rounds), answers, strict=True):
        differs = deviation(means, answers[0])
        lines.append({"workload": workload.name, **timing._asdict(), "differs": differs})
        print(
            f"{timing.name:44}{timing.nanoseconds:10.2f}{timing.ratio:9.2f}"
            f"{f'{timing.low:.2f} .. {timing.high:.2f}':>20}{timing.share:7.0%}{timing.compile_seconds:11.2f}"
            f"{'' if differs is None else f'{differs:.0e}':>9}"
        )
    for line in skipped:
        print(f"{line['name']:44}  skipped: {line['skipped']}")
    return lines + skipped


def deviation(means: np.ndarray | None, base: np.ndarray | None) -> float | None:
    """Largest difference of the last means, over the trajectories that both filtered; None for other data."""
    if means is None or base is None:
        return None
    return float(np.max(np.abs(means - base[: len(means)])))
