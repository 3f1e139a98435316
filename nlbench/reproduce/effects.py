"""What each erratum changes: the same statistic of the filter as printed and as corrected, on the same runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from nlbench.reproduce.summary import Effect, Erratum
from nlbench.results.results import Results

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.reproduce.documents import Comparison, Error
    from nlbench.reproduce.summary import ExperimentRun


class _Value(NamedTuple):
    value: float
    stderr: float
    n: int


class _What(NamedTuple):
    """A statistic of a coordinate at a time."""

    statistic: str
    coordinate: str
    time: float

    def rows(self, table: pd.DataFrame) -> pd.DataFrame:
        """The rows of a table that are of it."""
        times = table["time"].where(table["time"].astype(str) != "all", math.nan).astype(float)
        of = (table["statistic"] == self.statistic) & (table["coordinate"] == self.coordinate)
        return table[of & ((times - self.time).abs() < 1e-9)]


UNKNOWN = _Value(math.nan, math.nan, 0)


def erratum(error: Error, experiments: Mapping[str, ExperimentRun]) -> Erratum:
    """The record of an erratum; where an experiment was not run, its effects are missing and `why_not` says so."""
    folders = {name: experiments[name].folder for name in error.experiments}
    results = {name: Results(folder) for name, folder in folders.items() if folder is not None}
    missing = [name for name in error.experiments if name not in results]
    effects = tuple(
        _effect(each, results[each.experiment], results[each.against or each.experiment])
        for each in error.effects
        if each.experiment in results and (each.against or each.experiment) in results
    )
    return Erratum(
        document=error.document,
        number=error.number,
        equation=error.equation,
        printed=error.printed,
        right=error.right,
        consequence=error.consequence,
        why_not=error.why_not or (f"Not run: {', '.join(missing)}." if missing else ""),
        effects=effects,
    )


def _effect(comparison: Comparison, before: Results, after: Results) -> Effect:
    """The effect from the results that have the printed filter, and those that have the corrected one."""
    coordinate = comparison.coordinate or str(before.table("statistics")["coordinate"].iloc[0])
    time = comparison.time or before.experiment.report_times[-1]
    what = _What(comparison.statistic, coordinate, time)
    printed, corrected = _known(before, comparison.printed, what), _known(after, comparison.corrected, what)
    if comparison.against:
        stderr = math.hypot(printed.stderr, corrected.stderr)
        difference = _Value(printed.value - corrected.value, stderr, min(printed.n, corrected.n))
    else:
        difference = _difference(before.table("paired"), comparison.printed, comparison.corrected, what)
    return Effect(
        experiment=comparison.experiment,
        against=comparison.against or "",
        statistic=comparison.statistic,
        coordinate=coordinate,
        time=time,
        printed_label=comparison.printed,
        corrected_label=comparison.corrected,
        printed=printed.value,
        printed_stderr=printed.stderr,
        corrected=corrected.value,
        corrected_stderr=corrected.stderr,
        difference=difference.value,
        difference_stderr=difference.stderr,
        printed_diverged=_diverged(before, comparison.printed),
        corrected_diverged=_diverged(after, comparison.corrected),
        n=max(printed.n, corrected.n),
    )


def _known(results: Results, label: str, what: _What) -> _Value:
    table = results.table("statistics")
    return _value(what.rows(table[table["filter"] == label]), "value")


def _diverged(results: Results, label: str) -> float:
    table = results.table("divergence")
    return float(table.loc[table["filter"] == label, "fraction"].iloc[0])


def _difference(paired: pd.DataFrame, a: str, b: str, what: _What) -> _Value:
    """a minus b over the runs that both have."""
    here = what.rows(paired)
    forward = _value(here[(here["filter_a"] == a) & (here["filter_b"] == b)], "difference")
    if forward.n:
        return forward
    back = _value(here[(here["filter_a"] == b) & (here["filter_b"] == a)], "difference")
    return back._replace(value=-back.value)


def _value(rows: pd.DataFrame, column: str) -> _Value:
    if rows.empty:
        return UNKNOWN
    row = rows.iloc[0]
    return _Value(float(row[column]), float(row["stderr"]), int(row["n"]))
