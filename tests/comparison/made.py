"""Two sides to compare, from invented errors: tables and manifest as the engine makes them, by plain NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nlbench import config
from nlbench.comparison.side import NEEDED, Side
from nlbench.results.folder import RunFolder

TIMES = (1.0, 2.0)
CLIP = 5.0


def errors(
    seed: int, runs: int, filters: int = 3, times: int = 2, draw: str = "normal", share: float = 0.5
) -> np.ndarray:
    """(filters, times, runs), of which filters and times share part of the variance, as those of one truth do."""
    rng = np.random.default_rng(seed)
    kinds = {
        "normal": lambda *shape: rng.normal(size=shape),
        "t3": lambda *shape: rng.standard_t(3, size=shape),
        # One run in a hundred is lost from sight, with an error ten times as large.
        "mixture": lambda *shape: np.where(rng.random(shape) < 0.01, 10, 1) * rng.normal(size=shape),
    }
    common, own = kinds[draw](1, 1, runs), kinds[draw](filters, times, runs)
    return np.sqrt(share) * common + np.sqrt(1 - share) * own


@cache
def experiment(filters: int, seed: int, times: tuple[float, ...]) -> config.Experiment:
    """With filters called f1, f2, ..."""
    return config.from_dict(
        {
            "experiment": "tests/compared",
            "system": {"name": "culver-scalar"},
            "filters": [{"name": "third-order", "label": f"f{i + 1}"} for i in range(filters)],
            "time": {"end": 2.0, "step": 0.02, "output": 0.5},
            "report_times": list(times),
            "monte_carlo": {"seed": seed},
        }
    )


def tables(
    error: np.ndarray, lost: np.ndarray, times: tuple[float, ...], kept: int
) -> dict[str, pd.DataFrame]:
    """Of errors (filters, times, runs) of one coordinate x, of which some runs are lost."""
    labels = [f"f{i + 1}" for i in range(len(error))]
    rows: list[tuple] = []
    for f, label in enumerate(labels):
        for t, time in enumerate(times):
            alive = ~lost[f, t]
            capped = np.where(lost[f, t], CLIP, np.minimum(np.abs(error[f, t]), CLIP))
            for name, value in (("rms", error[f, t, alive]), ("rms_clipped", capped)):
                n = len(value)
                rms = np.sqrt(np.mean(value**2)) if n else np.nan
                spread = np.std(value**2) / np.sqrt(n - 1) if n > 1 else np.nan
                stderr = spread / (2 * rms) if rms > 0 else spread
                rows.append((label, str(time), "x", name, rms, stderr, n))
            own = error[f, t, alive]
            mean, spread = (own.mean(), own.std() / np.sqrt(len(own))) if len(own) else (np.nan, np.nan)
            rows.append((label, str(time), "x", "mean_error", mean, spread, len(own)))
            rows.append((label, str(time), "all", "nis", 1.0, 0.01, len(own)))
    columns = ["filter", "time", "coordinate", "statistic", "value", "stderr", "n"]
    kept_rows = [
        pd.DataFrame(
            {"filter": label, "time": time, "run": np.arange(kept), "x": error[f, t, :kept]}
            | {"x_variance": np.ones(kept, np.float32), "diverged": lost[f, t, :kept]}
        )
        for f, label in enumerate(labels)
        for t, time in enumerate(times)
    ]
    counts = lost.any(1).sum(-1)
    return {
        "statistics": pd.DataFrame(rows, columns=columns),
        "paired": pd.DataFrame({"filter_a": [], "filter_b": [], "time": []}),
        "runs": pd.concat(kept_rows, ignore_index=True),
        "divergence": pd.DataFrame({"filter": labels, "n": lost.shape[-1], "diverged": counts}),
    }


def facts(runs: int, seed: int, changes: Mapping[str, Any]) -> dict[str, Any]:
    """What a manifest says."""
    return {
        "runs": runs,
        "seed": seed,
        "hash": "0123456789ab",
        "block": 64,
        "units": {"x": "m"},
        "clip": {"x": CLIP},
        "norms": {},
        "versions": {"jax": "0.10.2"},
        "fingerprint": {"xla_flags": "--one"},
        **changes,
    }


def side(
    error: np.ndarray,
    seed: int,
    lost: np.ndarray | None = None,
    times: tuple[float, ...] = TIMES,
    kept: int | None = None,
    **manifest: Any,
) -> Side:
    """A side in memory."""
    lost = np.zeros(error.shape, bool) if lost is None else lost
    runs = error.shape[-1]
    made = tables(error, lost, times, runs if kept is None else kept)
    sums = {f"tables/{name}.parquet": f"{name} {seed} {error.sum()!r}" for name in NEEDED}
    told = facts(runs, seed, {"checksums": sums, **manifest})
    return Side(Path(f"seed-{seed}"), told, experiment(len(error), seed, times), made)


def folder(path: Path, given: Side, **manifest: Any) -> Path:
    """The folder of a run that holds a side."""
    run = RunFolder(path)
    run.write_experiment(given.experiment.resolved_yaml())
    run.write_tables(given.tables)
    told = {k: v for k, v in given.manifest.items() if k not in ("checksums", "runs")}
    run.finish(given.runs, **{**told, **manifest})
    return path
