"""The number of runs that a precision needs, from the first runs of the experiment: two-stage sampling.

Of the pilot's n runs, the same first ones whoever asks, with q(x) the quantity whose mean a statistic is (or is the
square root of, k = 2, otherwise k = 1), the standard error relative to the statistic is
  (1) r = sd q / (k |mean q| sqrt n),
for the median half the width of Woodruff's interval over its normal quantile. With the worst r of all filters,
coordinates and report times and the share p that is asked for,
  (2) N = MARGIN n (r / p)^2,  at least n, in whole blocks
(Cox 1952, Biometrika 39, 217-227, takes the variance from a first sample in the same way).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from nlbench import runtime
from nlbench.config.precision import RELATIVE_TO, Precision
from nlbench.engine.compiled import CAPACITY, compile_chunks
from nlbench.engine.driver import compute
from nlbench.engine.interruption import stop_requests
from nlbench.engine.memory import memory_faults
from nlbench.engine.problem import make
from nlbench.engine.resume import resumed
from nlbench.engine.workers import Threads
from nlbench.errors import ConfigError
from nlbench.results.folder import RunFolder
from nlbench.statistics.kept import Reported, magnitudes
from nlbench.statistics.uncertainty import NORMAL_975

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.engine.driver import Check, Progress
    from nlbench.statistics.layout import Layout
    from nlbench.statistics.totals import Totals

PILOT_RUNS = 4096
FEWEST = 2048  # that the totals always keep one by one
# In runs: 12 % in the standard error, since the pilot's own is uncertain and tails may be heavy.
MARGIN = 1.25
MOST_RUNS = 10**9


class Chosen(NamedTuple):
    """The runs that are needed; of the pilot's `pilot` runs the worst standard error, as a share, and whose; labels
    of filters without a usable value at some report time, which are left out there."""

    runs: int
    pilot: int
    share: float
    filter: str
    time: float
    coordinate: str
    left_out: tuple[str, ...]


def pilot_runs(layout: Layout) -> int:
    """How many of the first runs decide."""
    return max(FEWEST, min(PILOT_RUNS, layout.keep_runs))


def needed(precision: Precision, totals: Totals, block: int) -> Chosen:
    """Runs for the precision, from totals that hold the pilot's runs.

    Raises `ConfigError` where no filter has a usable value, and where more than `MOST_RUNS` runs would be needed.
    """
    layout, pilot = totals.layout, pilot_runs(totals.layout)
    runs = Reported(*(part[..., :pilot] for part in totals.kept.runs))
    share, names = relative_errors(precision.statistic, runs, layout)
    usable = np.isfinite(share)
    if not usable.any():
        raise ConfigError(
            f"--precision {precision}: no filter has a finite {precision.statistic} in the first {pilot:,} runs; "
            "give --runs"
        )
    worst = np.unravel_index(np.argmax(np.where(usable, share, -1.0)), share.shape)
    asked = MARGIN * pilot * (float(share[worst]) / precision.share) ** 2  # (2)
    if asked > MOST_RUNS:
        reachable = 100 * precision.share * math.sqrt(asked / MOST_RUNS)
        raise ConfigError(
            f"--precision {precision}: needs about {asked:.1e} runs, more than {MOST_RUNS:,}; "
            f"{precision.statistic}:{reachable:.2g}% can be reached"
        )
    f, r, c = map(int, worst)
    left_out = tuple(
        label for label, fine in zip(layout.filters, usable.all((1, 2)), strict=True) if not fine
    )
    count = block * math.ceil(max(asked, pilot) / block)
    found = float(share[worst])
    return Chosen(count, pilot, found, layout.filters[f], layout.report_times[r], names[c], left_out)


def relative_errors(statistic: str, runs: Reported, layout: Layout) -> tuple[np.ndarray, tuple[str, ...]]:
    """Standard errors (filters, report times, magnitudes) as shares of the statistic; and names of the last axis."""
    lost = runs.lost[:, :, None]
    size = magnitudes(runs.error, layout)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        if statistic == "median_error":
            return _of_median(np.where(lost, np.inf, size)), layout.magnitudes
        if statistic == "rms_clipped":
            clip = np.array(layout.magnitude_clip)[:, None] ** 2
            square = np.where(lost, clip, np.minimum(size**2, clip))
            return _of_mean(square, np.zeros_like(lost)) / 2, layout.magnitudes  # (1), k = 2
        if statistic == "rms":
            return _of_mean(size**2, lost) / 2, layout.magnitudes
        if statistic == "mean_error":
            return _of_error(runs.error, lost), layout.coordinates
        if statistic == "variance_actual":
            mean = _mean(runs.error, lost)[..., None]
            return _of_mean((runs.error - mean) ** 2, lost), layout.coordinates
        return _of_mean(runs.variance.astype(float), lost), layout.coordinates


def _of_mean(value: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """(1) with k = 1. Nothing but zeros is known exactly."""
    mean = _mean(value, lost)
    return np.where(_mean(np.abs(value), lost) == 0, 0.0, _stderr(value, lost) / np.abs(mean))


def _of_error(error: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """(1) for the mean error, as a share of the RMS error."""
    rms = np.sqrt(_mean(error**2, lost))
    return np.where(rms == 0, 0.0, _stderr(error, lost) / rms)


def _mean(value: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Over the runs that are not lost; not a number where all are."""
    return np.where(lost, 0.0, value).sum(-1) / (~lost).sum(-1)


def _stderr(value: np.ndarray, lost: np.ndarray) -> np.ndarray:
    """Of that mean; not a number where it is of fewer than two runs."""
    variance = _mean((value - _mean(value, lost)[..., None]) ** 2, lost)
    more = (~lost).sum(-1) - 1.0
    return np.sqrt(variance / np.where(more > 0, more, np.nan))


def _of_median(size: np.ndarray) -> np.ndarray:
    n = size.shape[-1]
    margin = NORMAL_975 / (2 * math.sqrt(n))
    low, high = (np.quantile(size, 0.5 + side, axis=-1, method="inverted_cdf") for side in (-margin, margin))
    return (high - low) / (2 * NORMAL_975) / np.median(size, axis=-1)


def choose(
    experiment: Experiment,
    precision: Precision,
    out: str | Path,
    progress: Progress | None = None,
    check: Check | None = None,
) -> Chosen:
    """Compute the pilot, where the results in `out` do not hold it already, and choose the runs.

    The pilot is the beginning of the run, which goes on from its checkpoint. It is the same whatever was computed
    before, and so is the choice. check: may raise before anything is computed. Raises what `run` raises.
    """
    with stop_requests() as stopped, memory_faults():
        problem = make(experiment)
        compiled = compile_chunks(problem, experiment.monte_carlo.seed)
        folder = RunFolder(experiment.folder(out))
        with folder.locked():
            totals = resumed(folder, compiled)
            blocks = math.ceil(pilot_runs(problem.layout) / problem.block)
            if totals.blocks < blocks:
                runs, threads = blocks * problem.block, experiment.engine.threads or runtime.threads()
                if check is not None:
                    check(compiled, totals, runs, threads, folder.path)
                folder.reopen()
                folder.write_experiment(experiment.resolved_yaml())
                chunk = experiment.engine.chunk or CAPACITY
                report = progress or (lambda done, total: None)
                with Threads(compiled, runs, threads) as workers:
                    totals = compute(compiled, folder, totals, runs, workers, chunk, report, stopped)
            return needed(precision, totals, problem.block)


def reached(precision: Precision, statistics: pd.DataFrame, report_times: Sequence[float]) -> float:
    """The worst share in a finished run's table of statistics; not a number where there is none."""
    key = ["filter", "time", "coordinate"]
    times = {repr(float(time)) for time in report_times}
    rows = statistics[statistics["time"].isin(times)]
    errors = rows[rows["statistic"] == precision.statistic].set_index(key)["stderr"]
    values = rows[rows["statistic"] == RELATIVE_TO[precision.statistic]].set_index(key)["value"]
    return float((errors / values).max())
