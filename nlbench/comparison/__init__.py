"""Is one finished run worse than another: `nlbench.compare` and the command `nlbench compare`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.results.results import Results

__all__ = ["compare"]

MARGIN, ALPHA = 0.01, 0.01


def compare(
    a: Results | str | Path,
    b: Results | str | Path,
    margin: float = MARGIN,
    alpha: float = ALPHA,
    statistics: Sequence[str] | str | None = None,
) -> pd.DataFrame:
    """Every comparison of two finished runs, the worst change from `a` to `b` first.

    a, b: what `nlbench.run` returned, or the folder of a run.
    margin: relative change that does not matter.
    alpha: probability that any comparison of two runs without a difference shows one.
    statistics: names; None for the RMS errors and the fraction of diverged runs at the report times; "all" for every
        statistic at these and over all times.

    Columns: `filter, time, coordinate, statistic`; `a, b, ratio` with its interval `low, high` at 1 - alpha; `n_a,
    n_b`, `paired`; `p` that there is no change and `p_margin` that it is within the margin, both after Holm; `detects`,
    the ratio above 1 that would be found beyond the margin nine times in ten; `verdict`, one of those in
    `nlbench.comparison.verdicts`.
    Raises `DamagedResults`, `ConfigError` for an unknown statistic, `NothingCompared`.
    """
    from nlbench.comparison.compared import Asked, compared

    return compared(a, b, Asked(margin, alpha, statistics)).table
