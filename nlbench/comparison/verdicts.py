"""What is said of a comparison, and whether it fails a gate.

FAILED     a filter, or a statistic of it, gave numbers in A and gives none in B
worse      B is worse than A by more than the margin
changed    the same of a statistic that is not good or bad in itself, such as a variance
slight     a significant change, of which it is not shown that it exceeds the margin
better     B is better than A by more than the margin
recovered  the opposite of FAILED
~          no significant change
few        too few runs for a test
=          the same on both sides, nothing to test
"""

from __future__ import annotations

import math

from nlbench.comparison.change import Measured

# Where more is worse (1) or better (-1); of other statistics neither is.
WORSE = {
    "rms": 1,
    "rms_clipped": 1,
    "rms_run_mean": 1,
    "median_error": 1,
    "diverged": 1,
    "log_likelihood": -1,
}
ORDER = ("FAILED", "worse", "changed", "slight", "better", "recovered", "~", "few", "=")
FAILING = ("FAILED", "worse", "changed")
EITHER_WAY = (*FAILING, "better", "recovered")


def missing(row: Measured) -> str | None:
    """FAILED or recovered where one side has no number."""
    if row.word:
        return row.word
    gone = not math.isfinite(row.b), not math.isfinite(row.a)
    return {(True, False): "FAILED", (False, True): "recovered"}.get(gone)


def verdict(row: Measured, significant: bool, beyond: bool) -> str:
    """Of a comparison: is there a change, does it exceed the margin?"""
    if word := missing(row):
        return word
    if row.same:
        return "="
    if not row.testable:
        return "few"
    if not beyond:
        return "slight" if significant else "~"
    direction = WORSE.get(row.quantity.statistic, 0) * (row.b - row.a)
    if direction == 0:
        return "changed"
    return "worse" if direction > 0 else "better"
