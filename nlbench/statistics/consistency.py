"""Whether filters are as wrong as they say: NEES and NIS against the chi-square bounds of a consistent filter.

NEES is e' P^-1 e of the error e and the covariance P that the filter states for it, NIS the same of the innovation. If
the filter is right and Gaussian, each is chi-square with as many degrees of freedom as there are entries, and the mean
over n independent ones lies with 95 % between the 2.5 % and the 97.5 % quantile of chi-square with n dof degrees, over
n (Bar-Shalom, Li and Kirubarajan 2001, 5.4). Above, the filter is overconfident; below, it is too cautious. An error
that is not Gaussian spreads more, so that even the exact posterior may lie outside; its mean is still dof.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from nlbench.statistics.chi_square import quantile
from nlbench.statistics.ieee import ieee
from nlbench.statistics.totals import Totals

TAIL = 0.025
COLUMNS = ("filter", "time", "score", "value", "stderr", "low", "high", "dof", "n", "consistent")


@ieee
def consistency_table(totals: Totals, statistics: pd.DataFrame, measurements: int) -> pd.DataFrame:
    """`filter, time, score, value, stderr, low, high, dof, n, consistent` of the joint NEES and the NIS.

    time: text, as in the table of statistics. n: what the mean is over, runs for NEES and samples for NIS. Where some
    samples were left out (`left_out_table`), the others are a selection, for which there are no bounds; consistent
    is then missing, as it is where nothing was counted. measurements: entries of a measurement.
    """
    layout = totals.layout
    rows = statistics[(statistics["coordinate"] == "all") & statistics["statistic"].isin(["nees", "nis"])]
    nis = rows["statistic"] == "nis"
    dof = np.where(nis, measurements, len(layout.coordinates))
    n, value = rows["n"].to_numpy(), rows["value"].to_numpy()
    bounded = np.where((n > 0) & ~(nis & _selected(totals, rows)), n, 0)
    low, high = (quantile(tail, bounded * dof) / n for tail in (TAIL, 1 - TAIL))
    consistent = pd.array((low <= value) & (value <= high), dtype="boolean")
    consistent[bounded == 0] = pd.NA
    made = rows.rename(columns={"statistic": "score"}).assign(
        low=low, high=high, dof=dof, consistent=consistent
    )
    return made.reset_index(drop=True)[list(COLUMNS)]


def left_out_table(totals: Totals) -> pd.DataFrame:
    """`filter, time, limited_or_guarded, invalid`: the measurements since the output time before (at `all`: of the runs
    that were never lost) of which NIS has no sample; only where there are some.

    invalid: foretold without a finite mean and a positive definite covariance.
    """
    layout = totals.layout
    counts = totals.groups.get("left_out", np.zeros((1, 2, len(layout.filters), len(layout.times)))).sum(0)
    times = [*(repr(float(time)) for time in layout.times[1:]), "all"]
    f, t = np.nonzero(counts.sum(0))
    limited_or_guarded, invalid = counts[:, f, t].astype(np.int64)
    return pd.DataFrame(
        {
            "filter": np.array(layout.filters, object)[f],
            "time": np.array(times, object)[t],
            "limited_or_guarded": limited_or_guarded,
            "invalid": invalid,
        }
    )


def _selected(totals: Totals, rows: pd.DataFrame) -> np.ndarray:
    """Decide whether samples were left out of a row's NIS."""
    table = left_out_table(totals)
    places = set(zip(table["filter"], table["time"], strict=True))
    return np.array([key in places for key in zip(rows["filter"], rows["time"], strict=True)], bool)
