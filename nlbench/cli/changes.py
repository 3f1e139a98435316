"""One comparison of two runs as cells of a table of text."""

from __future__ import annotations

import math
from typing import Any

from nlbench.cli import output

HEAD = ("", "t", "A", "B", "B/A", "p", "")
SHORT = {"rms_clipped": "clipped"}  # beside the name of a coordinate


def cells(row: dict[str, Any], several: bool) -> list[str]:
    """What is compared, when, A, B, B/A with its interval, p, verdict; `several`: the coordinate is named."""
    named = row["coordinate"] != "all" and several
    name = SHORT.get(row["statistic"], row["statistic"])
    what = f"{name} {row['coordinate']}" if named else row["statistic"]
    share = row["statistic"] == "diverged"
    a, b = (f"{output.percent(row[side])} %" if share else _number(row[side]) for side in ("a", "b"))
    time = row["time"] if row["time"] in ("any", "all") else f"{float(row['time']):g}"
    return [what, time, a, b, _ratio(row), _p(row["p"]), row["verdict"]]


def percent(fraction: float) -> str:
    """Of a number that was given: all its digits."""
    return f"{100 * fraction:.10g} %"


def _number(value: float) -> str:
    return "none" if math.isnan(value) else f"{value:.4g}"


def _ratio(row: dict[str, Any]) -> str:
    if not math.isfinite(row["ratio"]):
        return ""
    if not (math.isfinite(row["low"]) and math.isfinite(row["high"])):
        return f"{row['ratio']:.4g}"
    reach = row["high"] - row["low"]
    digits = 3 if reach == 0 else min(max(1 - math.floor(math.log10(reach)), 2), 5)
    return f"{row['ratio']:.{digits}f} [{row['low']:.{digits}f}, {row['high']:.{digits}f}]"


def _p(p: float) -> str:
    if math.isnan(p):
        return ""
    if p < 1e-99:
        return "<1e-99"
    return f"{p:.0e}" if p < 0.001 else f"{p:.3f}" if p < 0.1 else f"{p:.2f}"
