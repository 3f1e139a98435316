"""A run folder as the engine leaves it, with invented numbers: figures and the report are tested on it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

TIMES = np.round(np.arange(0, 2.01, 0.1), 12)
REPORT_TIMES = (1.0, 2.0)
FILTERS = {"linearised-kalman": 1.30, "second-order": 1.12, "third-order": 1.05, "exact": 1.0}


class SyntheticResults:
    """Behaves as `nlbench.results.results.Results` does, over tables that are given."""

    def __init__(
        self, path: Path, tables: dict[str, pd.DataFrame], experiment: SimpleNamespace, manifest: dict
    ):
        self.path, self.experiment, self.manifest, self._tables = path, experiment, manifest, tables
        (path / "tables").mkdir(parents=True)
        for name, table in tables.items():
            table.to_csv(path / "tables" / f"{name}.csv", index=False)

    def table(self, name: str) -> pd.DataFrame:
        return self._tables[name]


def results(
    path: Path,
    filters: dict[str, float] = FILTERS,
    coordinates: dict[str, str] = {"x": ""},
    diverged: dict[str, int] = {},
    runs: int = 20_000,
    extra: dict[str, pd.DataFrame] = {},
    **experiment: object,
) -> SyntheticResults:
    """A run in which the RMS error of each filter is a given multiple of the best one's."""
    tables = {
        "statistics": statistics(filters, coordinates, runs),
        "paired": paired(filters, coordinates, runs),
        "divergence": divergence(filters, diverged, runs),
        **extra,
    }
    return SyntheticResults(
        path, tables, specification(filters, runs, experiment), manifest(coordinates, runs)
    )


def statistics(filters: dict[str, float], coordinates: dict[str, str], runs: int) -> pd.DataFrame:
    rows = []
    for label, factor in filters.items():
        for coordinate in coordinates:
            for time in TIMES:
                rms = 0.4 * np.exp(-0.8 * time) * factor ** min(time, 1.0)
                values = {
                    "rms": rms,
                    "rms_clipped": 0.98 * rms,
                    "mean_error": 0.1 * (factor - 1) * time,
                    "variance_estimated": rms**2 / factor ** (6 * time),
                    "variance_actual": rms**2,
                    "third_estimated": 0.3 * rms**3 if label.startswith(("third", "exact")) else 0.0,
                    "third_actual": 0.4 * rms**3,
                }
                rows += [
                    (label, time, coordinate, name, value, 1.2 * rms / np.sqrt(runs), runs)
                    for name, value in values.items()
                ]
            rows += [
                (label, time, coordinate, "median_error", 0.5 * np.exp(-time), 0.002, runs)
                for time in REPORT_TIMES
            ]
            rows.append((label, "all", coordinate, "rms", 0.3 * factor, 0.002, runs))
    return pd.DataFrame(rows, columns=["filter", "time", "coordinate", "statistic", "value", "stderr", "n"])


def paired(filters: dict[str, float], coordinates: dict[str, str], runs: int) -> pd.DataFrame:
    rows = []
    labels = list(filters)
    for i, a in enumerate(labels):
        for b in labels[i + 1 :]:
            for time in REPORT_TIMES:
                difference = 0.4 * np.exp(-0.8 * time) * (filters[a] - filters[b])
                stderr = 0.3 / np.sqrt(runs)
                p = min(1.0, np.exp(-0.5 * (difference / stderr) ** 2))
                rows += [
                    (a, b, time, coordinate, statistic, difference, stderr, runs, p)
                    for coordinate in coordinates
                    for statistic in ("rms", "rms_clipped")
                ]
    columns = [
        "filter_a",
        "filter_b",
        "time",
        "coordinate",
        "statistic",
        "difference",
        "stderr",
        "n",
        "p_value",
    ]
    return pd.DataFrame(rows, columns=columns)


def divergence(filters: dict[str, float], diverged: dict[str, int], runs: int) -> pd.DataFrame:
    rows = []
    for label in filters:
        count = diverged.get(label, 0)
        fraction = count / runs
        rows.append(
            (
                label,
                runs,
                count,
                fraction,
                0.8 * fraction,
                1.2 * fraction + 1 / runs,
                1.5 if count else np.nan,
                0,
            )
        )
    columns = ["filter", "n", "diverged", "fraction", "low", "high", "first_time_median", "guarded"]
    return pd.DataFrame(rows, columns=columns)


def specification(filters: dict[str, float], runs: int, changes: dict[str, object]) -> SimpleNamespace:
    base = {
        "experiment": "tests/synthetic",
        "question": "Does carrying the third moment pay?",
        "reference": "exact" if "exact" in filters else None,
        "report_times": list(REPORT_TIMES),
        "source": SimpleNamespace(document="culver-1969", figures=["7.18"], tables=[], runs=80),
        "monte_carlo": SimpleNamespace(runs=runs, seed=1969),
        "figures": None,
        **changes,
    }
    resolved = {"experiment": base["experiment"], "filters": [{"label": label} for label in filters]}
    return SimpleNamespace(**base, resolved=lambda: resolved)


def manifest(coordinates: dict[str, str], runs: int) -> dict:
    return {
        "units": dict(coordinates),
        "runs": runs,
        "versions": {"nlbench": "0.1.0", "jax": "0.10.2"},
        "device": "cpu",
        "seed": 1969,
    }
