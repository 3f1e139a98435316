"""The table of `nlbench.compare`: p-values corrected together, intervals, verdicts; the worst change first."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import pandas as pd

from nlbench.comparison.change import Measured
from nlbench.comparison.significance import holm
from nlbench.comparison.verdicts import ORDER, verdict

COLUMNS = (
    *("filter", "time", "coordinate", "statistic", "a", "b", "ratio", "low", "high", "n_a", "n_b", "paired"),
    *("p", "p_margin", "detects", "verdict"),
)


class Asked(NamedTuple):
    """What to compare, and how; see `nlbench.compare`."""

    margin: float
    alpha: float
    statistics: Sequence[str] | str | None = None


def table(rows: list[Measured], tested: list[Measured], asked: Asked) -> pd.DataFrame:
    """All comparisons; those that were tested share Holm's correction."""
    count = max(len(tested), 1)
    p = holm([_p(row, 0.0) for row in tested])
    p_margin = holm([_p(row, asked.margin) for row in tested])
    of = {id(row): (float(p[i]), float(p_margin[i])) for i, row in enumerate(tested)}
    made = []
    for row in rows:
        own = of.get(id(row), (math.nan, math.nan))
        word = verdict(row, own[0] <= asked.alpha, own[1] <= asked.alpha)
        q = row.quantity
        made.append(
            (q.filter, str(q.time), q.coordinate, q.statistic, row.a, row.b, *_interval(row, asked.alpha))
            + (row.n_a, row.n_b, row.paired, *own, _detects(row, asked, count), word)
        )
    table = pd.DataFrame(made, columns=COLUMNS)
    rank = table["verdict"].map(ORDER.index)
    order = pd.DataFrame({"rank": rank, "p": table["p_margin"].fillna(-1), "ratio": -table["ratio"]})
    return table.loc[order.sort_values(["rank", "p", "ratio"], kind="stable").index].reset_index(drop=True)


def _p(row: Measured, margin: float) -> float:
    """Of a change beyond the margin. Fractions of diverged runs are tested for equality; beyond the margin is one whose
    ratio is."""
    if row.change is not None:
        return row.change.p_beyond(row.slack(margin))
    low, high = sorted((row.a, row.b))
    return row.p if high > (1 + margin) * low else 1.0


def _interval(row: Measured, alpha: float) -> tuple[float, float, float]:
    if row.change is None:
        return (row.b / row.a if row.a else math.nan if row.b == 0 else math.inf), math.nan, math.nan
    if not row.testable and not row.same:
        return row.ratio(row.change.effect), math.nan, math.nan
    low, high = row.change.interval(alpha)
    return row.ratio(row.change.effect), row.ratio(low), row.ratio(high)


def _detects(row: Measured, asked: Asked, count: int) -> float:
    if row.change is None or not row.testable:
        return math.nan
    return row.ratio(row.change.detects(row.slack(asked.margin), asked.alpha / count))
