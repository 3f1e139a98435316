"""Medians of |error| at the report times; a lost run counts as infinite.

The standard error is half the width of Woodruff's (1952) interval over its normal quantile: the interval's
ends are the quantiles at 1/2 -+ 1.96 / (2 sqrt n), so no density is estimated.
"""

import numpy as np

from nlbench.statistics import histogram
from nlbench.statistics.averages import Estimate
from nlbench.statistics.ieee import ieee
from nlbench.statistics.kept import magnitudes
from nlbench.statistics.totals import Totals
from nlbench.statistics.uncertainty import NORMAL_975


@ieee
def medians(totals: Totals) -> Estimate:
    """Exact while all runs are kept, otherwise from the histograms."""
    layout, n = totals.layout, totals.runs
    margin = NORMAL_975 / (2 * np.sqrt(n))
    fractions = (0.5, max(0.5 - margin, 0.0), min(0.5 + margin, 1.0))
    if totals.all_kept:
        size = magnitudes(totals.kept.error, layout)
        size = np.where(totals.kept.lost[:, :, None], np.inf, size)
        value = np.median(size, axis=-1)
        low, high = (
            np.quantile(size, fraction, axis=-1, method="inverted_cdf") for fraction in fractions[1:]
        )
    else:
        scale = np.array(layout.scale)
        value, low, high = (scale * histogram.quantile(totals.histogram, fraction) for fraction in fractions)
    stderr = np.where(np.isinf(value), np.nan, (high - low) / (2 * NORMAL_975))
    count = np.full(value.shape, n, np.int64)
    return Estimate("median_error", layout.report_times, layout.magnitudes, value, stderr, count)
