"""What an author with few runs would have seen: statistics of sets of a given size, drawn from the kept runs.

All filters of a set have the same runs, as those of the source had. A set is drawn with replacement, by a fixed
sequence of random numbers, so that the tables depend on nothing but the runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from nlbench.statistics.claim import Claim
from nlbench.statistics.comparisons import Quantity, terms
from nlbench.statistics.ieee import ieee
from nlbench.statistics.uncertainty import NORMAL_975, wilson

SIZES = (10, 20, 80)  # the runs of a test in Culver 1969; Schwartz 1967 made ten
SETS = 2000
SEED = 1969
COLUMNS = ("id", "runs", "sets", "share", "low", "high")


class KeptTable:
    """The table of kept runs, by filter and time. `clip` and `norms` are those of `Layout`, by name.

    coordinates: names of the errors, in the order of the table's columns.
    """

    def __init__(self, runs: pd.DataFrame, clip: Mapping[str, float], norms: Mapping[str, Sequence[str]]):
        self.clip, self.norms = dict(clip), {name: list(members) for name, members in norms.items()}
        # The order of `clip` means nothing: a manifest sorts its keys.
        self.coordinates = [name for name in runs.columns if name in self.clip and name not in self.norms]
        self._rows = {
            (str(label), round(float(time), 9)): rows
            for (label, time), rows in runs.groupby(["filter", "time"], sort=False)
        }
        self.count = min((len(rows) for rows in self._rows.values()), default=0)
        self._columns: dict[tuple[str, float, str], np.ndarray] = {}

    def column(self, label: str, time: float, name: str) -> np.ndarray | None:
        """A column of one filter at one time; None where the table does not have it."""
        rows = self._rows.get((label, round(time, 9)))
        if rows is None or name not in rows:
            return None
        key = (label, round(time, 9), name)
        if key not in self._columns:
            self._columns[key] = rows[name].to_numpy()[: self.count]
        return self._columns[key]

    def columns(self, label: str, time: float, names: Iterable[str]) -> list[np.ndarray] | None:
        """Several columns; None unless the table has them all."""
        found = [self.column(label, time, name) for name in names]
        return None if any(each is None for each in found) else found  # type: ignore[return-value]

    def drawn(self, size: int, sets: int = SETS) -> np.ndarray:
        """Numbers of the runs of each set, (sets, size)."""
        return np.random.default_rng((SEED, size)).integers(0, self.count, (sets, size))

    @ieee
    def value(self, quantity: Quantity, drawn: np.ndarray) -> np.ndarray | None:
        """The statistic of each set, (sets,); None where it cannot be had from what was kept."""
        members = self.norms.get(quantity.coordinate, [quantity.coordinate])
        if quantity.statistic == "diverged":
            lost = self.column(quantity.filter, quantity.time, "diverged")
            return None if lost is None else lost[drawn].mean(1)
        suffix = {"variance_estimated": "_variance", "third_estimated": "_third"}.get(quantity.statistic, "")
        names = [f"{member}{suffix}" for member in members] + ["diverged"]
        if quantity.statistic in ("nees", "coverage_95"):
            names.insert(1, f"{quantity.coordinate}_variance")
        found = self.columns(quantity.filter, quantity.time, names)
        formula = FORMULAS.get(quantity.statistic)
        norm = len(members) > 1
        if found is None or formula is None or (norm and quantity.statistic not in OF_NORMS):
            return None
        *parts, lost = (column[drawn] for column in found)
        if quantity.statistic in OF_NORMS:
            size = np.sqrt(sum(part**2 for part in parts)) if norm else np.abs(parts[0])
            return formula(size, lost, self.clip.get(quantity.coordinate, math.inf))
        return formula(*parts, ~lost)


def sets_table(claims: Iterable[Claim], kept: KeptTable, source_runs: int | None) -> pd.DataFrame:
    """`id, runs, sets, share, low, high`: in which share of sets of so many runs every comparison of a claim points
    the way it claims, with Wilson's interval for the draw of the sets. Claims on statistics that are not kept run by
    run have no rows.
    """
    rows = []
    for size in sorted({*SIZES, *([source_runs] if source_runs else [])}):
        if size > kept.count:
            continue
        drawn = kept.drawn(size)
        values: dict[Quantity, np.ndarray | None] = {}
        for claim in claims:
            shown = _shown(claim, kept, drawn, values)
            if shown is not None:
                low, high = wilson(np.asarray(shown.sum()), len(shown))
                rows.append((claim.id, size, len(shown), shown.mean(), float(low), float(high)))
    return pd.DataFrame(rows, columns=COLUMNS)


@ieee
def _shown(
    claim: Claim, kept: KeptTable, drawn: np.ndarray, values: dict[Quantity, np.ndarray | None]
) -> np.ndarray | None:
    """Which sets show the claim."""
    shown = None
    for term in terms(claim, kept.coordinates[0], claim.at):
        for quantity in term.quantities:
            if quantity not in values:
                values[quantity] = kept.value(quantity, drawn)
        of = [values[quantity] for quantity in term.quantities]
        if any(each is None for each in of):
            return None
        here = np.asarray(term.margin(of)) < 0
        shown = here if shown is None else shown & here
    return shown


def _mean(values: np.ndarray, alive: np.ndarray) -> np.ndarray:
    """Over the runs of each set that are not lost."""
    return np.where(alive, values, 0.0).sum(1) / alive.sum(1)


def _central(error: np.ndarray, alive: np.ndarray, power: int) -> np.ndarray:
    return _mean((error - _mean(error, alive)[:, None]) ** power, alive)


def _clipped(size: np.ndarray, lost: np.ndarray, clip: float) -> np.ndarray:
    return np.sqrt((np.where(lost, clip, np.minimum(size, clip)) ** 2).mean(1))


# Of |error| or a norm of errors, the lost runs, and the clip.
OF_NORMS = ("rms", "rms_clipped", "median_error")
FORMULAS: dict[str, Callable[..., np.ndarray]] = {
    "rms": lambda size, lost, clip: np.sqrt(_mean(size**2, ~lost)),
    "rms_clipped": _clipped,
    "median_error": lambda size, lost, clip: np.median(np.where(lost, np.inf, size), axis=1),
    "mean_error": _mean,
    "variance_actual": lambda error, alive: _central(error, alive, 2),
    "third_actual": lambda error, alive: _central(error, alive, 3),
    "variance_estimated": _mean,
    "third_estimated": _mean,
    "nees": lambda error, variance, alive: _mean(error**2 / variance, alive & (variance > 0)),
    "coverage_95": lambda error, variance, alive: _mean(error**2 <= NORMAL_975**2 * variance, alive),
}
