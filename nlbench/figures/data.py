"""What the figures need of a run, read once from its saved tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from nlbench.results.results import Results


class Curve(NamedTuple):
    """A statistic against time, with its standard error and the number of runs behind each point."""

    time: np.ndarray
    value: np.ndarray
    stderr: np.ndarray
    n: np.ndarray


class Data(NamedTuple):
    """Curves and tables of a run. `baseline` is the filter that others are drawn relative to; `norms` are the names of
    those among the coordinates; `saved` reads a table that only some figures need, None where the run has none."""

    filters: tuple[str, ...]
    baseline: str
    reference: str | None
    units: dict[str, str]
    source_runs: int | None
    runs: int
    curves: dict[tuple[str, str, str], Curve]
    paired: pd.DataFrame
    divergence: pd.DataFrame
    traces: pd.DataFrame
    norms: tuple[str, ...]
    saved: Callable[[str], pd.DataFrame | None]
    consistency: pd.DataFrame | None = None
    bounds: pd.DataFrame | None = None

    def coordinates(self, statistic: str) -> tuple[str, ...]:
        """Coordinates (and named norms) for which the statistic was saved at more than one time, in table order."""
        found = (c for (_, c, s), curve in self.curves.items() if s == statistic and len(curve.time) > 1)
        return tuple(dict.fromkeys(found))

    def curve(self, label: str, coordinate: str, statistic: str) -> Curve:
        """The curve of a filter; empty where the table has none."""
        nothing = np.empty(0)
        return self.curves.get((label, coordinate, statistic), Curve(nothing, nothing, nothing, nothing))

    def at(self, label: str, coordinate: str, statistic: str, time: float) -> tuple[float, float]:
        """Value and standard error at a time; NaN where the table has none."""
        curve = self.curve(label, coordinate, statistic)
        here = np.flatnonzero(np.abs(curve.time - time) < 1e-9)
        return (float(curve.value[here[0]]), float(curve.stderr[here[0]])) if here.size else (np.nan, np.nan)

    def bound(self, coordinate: str) -> Curve | None:
        """The Cramer-Rao bound of RMS errors, known without error; None where there is none."""
        if self.bounds is None:
            return None
        rows = self.bounds[(self.bounds["coordinate"] == coordinate) & (self.bounds["statistic"] == "pcrb")]
        time, value, n = (rows[column].to_numpy(float) for column in ("time", "value", "n"))
        return Curve(time, value, np.zeros_like(value), n) if len(rows) else None

    @property
    def any_diverged(self) -> bool:
        """Whether any filter lost a run."""
        return bool((self.divergence["diverged"] > 0).any())


def read(results: Results) -> Data:
    """The data of a results folder."""
    statistics = results.table("statistics")
    experiment = results.experiment
    filters = tuple(dict.fromkeys(statistics["filter"]))
    reference = experiment.reference_label if experiment.reference_label in filters else None
    curves = _curves(statistics)
    return Data(
        filters=filters,
        baseline=reference or _best(filters, curves),
        reference=reference,
        units=units(results),
        source_runs=experiment.source.runs,
        runs=results.manifest["runs"],
        curves=curves,
        paired=results.table("paired"),
        divergence=results.table("divergence"),
        traces=results.table("traces")
        if "traces" in results.tables
        else pd.DataFrame(columns=["trajectory"]),
        norms=tuple(results.manifest.get("norms", {})),
        saved=partial(_saved, results),
        consistency=_saved(results, "consistency"),
        bounds=_saved(results, "bounds"),
    )


def chosen(data: Data, filters: Sequence[str] | None) -> Data:
    """With those filters only, in the order of the tables; the baseline is one of them."""
    if filters is None:
        return data
    kept = tuple(label for label in data.filters if label in filters)
    baseline = data.baseline if data.baseline in kept else _best(kept, data.curves)
    reference = data.reference if data.reference in kept else None
    return data._replace(filters=kept, baseline=baseline, reference=reference)


def _saved(results: Results, name: str) -> pd.DataFrame | None:
    return results.table(name) if name in results.tables else None


def units(results: Results) -> dict[str, str]:
    """Unit of each coordinate and of `time`; empty for none."""
    return {"time": "s", **results.manifest.get("units", {})}


def _curves(statistics: pd.DataFrame) -> dict[tuple[str, str, str], Curve]:
    time = pd.to_numeric(statistics["time"], errors="coerce")
    dated = statistics.assign(time=time).dropna(subset="time")
    groups = dated.groupby(["filter", "coordinate", "statistic"], sort=False)
    columns = ("time", "value", "stderr", "n")
    return {
        key: Curve(*(rows.sort_values("time")[column].to_numpy(float) for column in columns))
        for key, rows in groups
    }


def _best(filters: tuple[str, ...], curves: dict[tuple[str, str, str], Curve]) -> str:
    """Without a reference: the filter whose clipped RMS error ends lowest (in the first coordinate)."""
    final = {
        f: c.value[-1] for (f, _, s), c in reversed(curves.items()) if s == "rms_clipped" and len(c.value)
    }
    return min(filters, key=lambda f: np.nan_to_num(final.get(f, np.inf), nan=np.inf))
