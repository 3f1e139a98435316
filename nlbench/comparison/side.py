"""One of the two runs that are compared: its tables, looked up by what they are of, and its kept runs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nlbench.comparison.per_run import PerRun, influences, per_run
from nlbench.comparison.significance import Estimate, effective_degrees, standard_error
from nlbench.errors import ConfigError, DamagedResults
from nlbench.results.folder import MANIFEST, TABLES, RunFolder
from nlbench.results.results import Results
from nlbench.statistics.comparisons import UNKNOWN, Quantity, Tables
from nlbench.statistics.layout import GROUPS
from nlbench.statistics.sets import KeptTable

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from nlbench.config import Experiment


NEEDED = ("statistics", "paired", "divergence", "runs")


class Side:
    """The tables needed are statistics, paired, divergence and runs."""

    def __init__(
        self,
        path: Path,
        manifest: Mapping[str, Any],
        experiment: Experiment,
        tables: Mapping[str, pd.DataFrame],
    ):
        self.path, self.manifest, self.experiment = path, manifest, experiment
        self.runs, self.seed = int(self.manifest["runs"]), int(self.manifest["seed"])
        self.units: dict[str, str] = self.manifest["units"]
        self.clip = {name: math.inf if most is None else most for name, most in self.manifest["clip"].items()}
        self.tables = tables
        self._lookup = Tables(tables["statistics"], tables["paired"])
        self.kept = KeptTable(tables["runs"], self.clip, self.manifest["norms"])
        self._divergence = tables["divergence"].set_index("filter")

    @property
    def checksums(self) -> dict[str, str]:
        """Of the tables that are compared."""
        names = [f"{TABLES}/{name}.parquet" for name in NEEDED]
        return {name: self.manifest["checksums"][name] for name in names}

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the filters, in the order of the file."""
        return tuple(self._divergence.index)

    @property
    def report_times(self) -> tuple[float, ...]:
        """The times of medians, kept runs and claims."""
        return tuple(self.experiment.report_times)

    @property
    def all_kept(self) -> bool:
        """Whether the errors of all runs are at hand."""
        return self.kept.count == self.runs

    def failed(self, label: str) -> bool:
        """Whether no run of the filter gave a usable estimate."""
        return self.diverged(label) >= self.runs

    def diverged(self, label: str) -> int:
        """Runs that were lost at any report time."""
        return int(self._divergence.loc[label, "diverged"])

    def has(self, quantity: Quantity) -> bool:
        """Whether the table of statistics has it, be it NaN."""
        return self._lookup.known(quantity) is not UNKNOWN

    def per_run(self, quantity: Quantity) -> PerRun | None:
        """What enters a statistic, of every kept run."""
        return None if quantity.time == "all" else per_run(self.kept, quantity)

    def clips(self, coordinate: str) -> bool:
        """Whether errors of a coordinate are capped in clipped statistics."""
        return math.isfinite(self.clip.get(coordinate, math.inf))

    def lost(self, label: str, times: tuple[float, ...]) -> np.ndarray:
        """Which of the kept runs were lost at any of these report times, (runs,)."""
        columns = [self.kept.column(label, time, "diverged") for time in times]
        return np.logical_or.reduce([each for each in columns if each is not None] or [np.zeros(0, bool)])

    def estimate(self, quantity: Quantity) -> Estimate:
        """A statistic with its standard error: of the kept runs if they are all, otherwise from the table.

        The standard error of the table comes from groups of blocks, so it has as many degrees of freedom as there are
        groups, less one; fewer where the kept runs show heavy tails.
        """
        own = self.per_run(quantity)
        count = 0 if own is None else int(own.counted.sum())
        if own is not None and count > 1:
            value, influence = influences(quantity.statistic, own.values[own.counted])
            degrees = effective_degrees(influence)
            if self.all_kept:
                return Estimate(value, standard_error(influence), count, degrees)
        known = self._lookup.known(quantity)
        groups: float = min(GROUPS, math.ceil(self.runs / int(self.manifest["block"]))) - 1
        if own is not None and count > 1:
            exact = degrees * known.n / count
            groups = 1 / (1 / exact + 1 / groups) if groups else 0
        return Estimate(*known, groups)


def opened(where: Results | str | Path) -> Side:
    """The run in a folder, or the only run of an experiment's folder.

    Raises `ConfigError` where there is none or more than one, `EnvironmentFault` for a run that is not finished,
    `DamagedResults`, naming the files, where they are not those that the run wrote.
    """
    results = where if isinstance(where, Results) else Results(_folder(Path(where)))
    if faults := results.damaged():
        raise DamagedResults("\n".join(faults))
    tables = {name: results.table(name) for name in NEEDED}
    return Side(results.path, results.manifest, results.experiment, tables)


def _folder(folder: Path) -> Path:
    if not folder.is_dir():
        raise ConfigError(f"{folder}: no such folder of a run")
    if not (folder / MANIFEST).exists() and not (folder / "batches").is_dir():
        runs = sorted(each.parent for each in folder.glob(f"*/{MANIFEST}"))
        if len(runs) != 1:
            held = "no run" if not runs else f"{len(runs)} runs, name one: {', '.join(map(str, runs))}"
            raise ConfigError(f"{folder}: holds {held}")
        (folder,) = runs
    RunFolder(folder).check_finished()
    return folder
