"""A run's folder as the engine leaves it, with invented numbers: figures and report are tested on it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from nlbench import config
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results

TIMES = [round(0.1 * index, 12) for index in range(21)]
REPORT_TIMES = (1.0, 2.0)
FACTORS = {
    "linearised-kalman": 1.3,
    "second-order": 1.12,
    "third-order": 1.001,
    "third-order-guarded": 1.0,
    "exact": 0.9,
}
POWER = {"rms": 1, "rms_clipped": 1, "mean_error": 1, "variance_estimated": 2, "variance_actual": 2,
         "third_estimated": 3, "third_actual": 3}  # fmt: skip


def results(
    folder: Path,
    factors: Mapping[str, float] = FACTORS,
    coordinates: Mapping[str, str] | None = None,
    diverged: Mapping[str, int] | None = None,
    runs: int = 20_000,
    tables: Mapping[str, pd.DataFrame] | None = None,
    question: str = "",
    **experiment: Any,
) -> Results:
    """A finished run in which the RMS error of each filter is a given multiple of the same curve.

    `coordinates` are names with units, `diverged` counts per filter; `tables` replaces tables or adds some;
    `experiment` are keys of the experiment file.
    """
    coordinates = coordinates or {"x": ""}
    made = {
        "statistics": statistics(factors, coordinates, runs),
        "paired": paired(factors, coordinates, runs),
        "divergence": divergence(factors, diverged or {}, runs),
        **(tables or {}),
    }
    run = RunFolder(folder)
    run.write_experiment(specification(factors, question, experiment).resolved_yaml())
    run.write_tables(made)
    run.finish(
        runs,
        seed=1969,
        hash="0123456789ab",
        units=dict(coordinates),
        seconds=12.3,
        finished="2026-01-02T03:04:05+00:00",
        device="cpu",
        versions={"jax": "0.10.2"},
        fingerprint={"xla_flags": "--one --two"},
    )
    return Results(folder)


def specification(
    factors: Mapping[str, float], question: str, changes: Mapping[str, Any]
) -> config.Experiment:
    """An experiment with filters of these labels."""
    filters = [{"name": "third-order", "label": label} for label in factors if label != "exact"]
    plain = {
        "experiment": "tests/synthetic",
        "system": {"name": "culver-scalar"},
        "filters": filters,
        "reference": "exact" if "exact" in factors else None,
        "time": {"end": 2.0, "step": 0.02, "output": 0.1},
        "report_times": list(REPORT_TIMES),
        "source": {"document": "culver-1969", "figures": ["7.18"], "runs": 80},
        **changes,
    }
    return config.from_dict(plain, question)


def statistics(factors: Mapping[str, float], coordinates: Mapping[str, str], runs: int) -> pd.DataFrame:
    """Curves that fall with time; the estimated variance is smaller the worse the filter."""
    rows: list[tuple] = []
    for label, factor in factors.items():
        for coordinate in coordinates:
            for time in TIMES:
                rms = 0.4 * np.exp(-0.8 * time) * factor ** min(time, 1.0)
                for name, power in POWER.items():
                    value = rms**power / (factor if name.endswith("estimated") else 1.0)
                    rows.append(
                        (label, str(time), coordinate, name, value, 0.9 * power * value / runs**0.5, runs)
                    )
            rows.append((label, "all", coordinate, "rms", 0.3 * factor, 0.002, runs))
            rows.append((label, "2.0", coordinate, "median_error", 0.1, 0.002, runs))
    return pd.DataFrame(rows, columns=["filter", "time", "coordinate", "statistic", "value", "stderr", "n"])


def paired(factors: Mapping[str, float], coordinates: Mapping[str, str], runs: int) -> pd.DataFrame:
    """Differences whose standard error is that of a tenth of the common curve; p-values fall as they grow."""
    labels, rows = list(factors), []
    for place, a in enumerate(labels):
        for b in labels[place + 1 :]:
            for time in REPORT_TIMES:
                scale = 0.4 * np.exp(-0.8 * time)
                difference, stderr = scale * (factors[a] - factors[b]), scale / (2 * runs) ** 0.5
                p_value = float(np.exp(-0.5 * (difference / stderr) ** 2))
                for coordinate in coordinates:
                    for name in ("rms", "rms_clipped"):
                        rows.append((a, b, time, coordinate, name, difference, stderr, runs, p_value))
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


def divergence(factors: Mapping[str, float], diverged: Mapping[str, int], runs: int) -> pd.DataFrame:
    """Counts with an interval about them."""
    count = np.array([diverged.get(label, 0) for label in factors])
    return pd.DataFrame(
        {
            "filter": list(factors),
            "n": runs,
            "diverged": count,
            "fraction": count / runs,
            "low": 0.8 * count / runs,
            "high": (1.2 * count + 4) / runs,
            "first_time_median": np.where(count > 0, 1.5, np.nan),
            "guarded": [3 if "guarded" in label else 0 for label in factors],
            "guarded_fraction": [0.001 if "guarded" in label else 0.0 for label in factors],
        }
    )


def consistency(factors: Mapping[str, float], runs: int) -> pd.DataFrame:
    """NEES of two coordinates, twice the factor; NIS of one entry, one for all: selected where the guard fires."""
    rows: list[tuple] = []
    half = 1.96 * (2 / runs) ** 0.5
    for label, factor in factors.items():
        for time in [*map(str, TIMES), "all"]:
            scores = [("nis", 1.0, 1)] if time == "all" else [("nees", 2 * factor, 2), ("nis", 1.0, 1)]
            for score, value, dof in scores:
                reach = half * dof**0.5
                known = score == "nees" or "guarded" not in label
                low, high = (dof - reach, dof + reach) if known else (np.nan, np.nan)
                inside = low <= value <= high if known else None
                rows.append((label, time, score, value, reach / 1.96, low, high, dof, runs, inside))
    columns = ["filter", "time", "score", "value", "stderr", "low", "high", "dof", "n", "consistent"]
    return pd.DataFrame(rows, columns=columns).astype({"consistent": "boolean"})


def kept(factors: Mapping[str, float], coordinates: Mapping[str, str], runs: int) -> pd.DataFrame:
    """Kept runs whose errors are gamma-distributed about zero, with the variance and the third moment that they have;
    the variance stated is smaller the worse the filter."""
    generator, made = np.random.default_rng(5), []
    for label, factor in factors.items():
        for time in REPORT_TIMES:
            scale = 0.1 * np.exp(-0.8 * time)
            columns = {"filter": label, "time": time, "run": np.arange(runs)}
            for coordinate in coordinates:
                columns[coordinate] = scale * factor * (generator.gamma(4.0, size=runs) - 4.0)
            for coordinate in coordinates:
                columns[f"{coordinate}_variance"] = np.full(runs, 4 * scale**2 / factor, np.float32)
                columns[f"{coordinate}_third"] = np.full(runs, 8 * scale**3, np.float32)
            made.append(pd.DataFrame({**columns, "diverged": False}))
    return pd.concat(made, ignore_index=True)


def claims() -> pd.DataFrame:
    """One claim of each verdict; the last is ours."""
    rows = [
        (
            f"C{index}",
            f"claim number {index}",
            verdict,
            -0.01,
            -0.02,
            0.005,
            20_000,
            where,
            whose,
            "7.18 7.19",
        )
        for index, (verdict, where, whose) in enumerate(
            [
                ("confirmed", "section 7.3, page 7-9", "source"),
                ("refuted", "", "source"),
                ("undecided", "", "ours"),
            ]
        )
    ]
    columns = ["id", "says", "verdict", "estimate", "low", "high", "n", "where", "whose", "figures"]
    return pd.DataFrame(rows, columns=columns)


def sets() -> pd.DataFrame:
    """How often sets of 10 and of 80 runs show the first two claims; of the second, only sets of 80 are known."""
    rows = [
        ("C0", 10, 2_000, 0.63, 0.61, 0.65),
        ("C0", 80, 250, 0.93, 0.89, 0.96),
        ("C1", 80, 250, 0.0, 0.0, 0.015),
    ]
    return pd.DataFrame(rows, columns=["id", "runs", "sets", "share", "low", "high"])


def responses(factors: Mapping[str, float], coordinates: Mapping[str, str], runs: tuple) -> pd.DataFrame:
    """Truth cos t, an estimate that is off by a tenth of the factor, and a measurement at every second time."""
    times, made = np.array(TIMES), []
    for run in runs:
        curves = [("truth", "", name, times, np.cos(times)) for name in coordinates]
        curves += [
            ("estimate", label, name, times, np.cos(times) + 0.1 * factor)
            for label, factor in factors.items()
            for name in coordinates
        ]
        curves.append(("measurement", "", "y1", times[::2], 30 * np.sin(9 * times[::2])))
        for kind, label, name, at, value in curves:
            labels = {"trajectory": run, "kind": kind, "filter": label, "name": name}
            made.append(pd.DataFrame({**labels, "time": at, "value": value}))
    return pd.concat(made, ignore_index=True)


def costs(factors: Mapping[str, float]) -> pd.DataFrame:
    """Costs of all filters: each ten times that of the one before."""
    return pd.DataFrame({"filter": list(factors), "ns_per_step": [10.0**i for i in range(len(factors))]})


def cost() -> pd.DataFrame:
    """Cost of one filter."""
    return pd.DataFrame({"filter": ["third-order"], "ns_per_step": [3.21], "operations_per_step": [125]})
