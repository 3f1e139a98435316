"""Why there is no number: which filters gave none at all and where each first went wrong, and what NIS leaves out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("filter", "run", "time", "part", "what")


def rms_rows(statistics: pd.DataFrame, report_times: Iterable[float]) -> list[dict[str, Any]]:
    """Take the RMS errors at the report times from the table `statistics`."""
    rms = statistics[(statistics["statistic"] == "rms") & ~statistics["time"].astype(str).eq("all")]
    near = rms["time"].astype(float).round(9).isin([round(time, 9) for time in report_times])
    return rms[near].to_dict(orient="records")


def failed(divergence: Sequence[dict[str, Any]], rms: Sequence[dict[str, Any]]) -> list[str]:
    """List the filters without a single usable number: every run diverged, or every rms is NaN."""
    labels = []
    for row in divergence:
        values = [each["value"] for each in rms if each["filter"] == row["filter"]]
        if row["diverged"] >= row["n"] or (values and all(math.isnan(value) for value in values)):
            labels.append(row["filter"])
    return labels


def told(row: dict[str, Any]) -> str:
    """Say what a row of the table `failures` says."""
    if row["run"] < 0:
        return row["what"]
    where = f", in the {row['part']}" if row["part"] else ""
    return f"first at t = {row['time']:g}{where} (run {row['run']}): {row['what']}"


def not_finite(names: Sequence[str]) -> str:
    """Say that these moments are not finite."""
    return f"the {listed(names)} {'is' if len(names) == 1 else 'are'} not finite"


def listed(words: Sequence[str]) -> str:
    """Join words by commas, the last by `and`."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def left_out(row: dict[str, Any]) -> str:
    """Say what a row of the table `left_out` says."""
    words = {"limited_or_guarded": "limited or guarded", "invalid": "without a valid covariance"}
    return listed([f"{row[name]:,.0f} {kind}" for name, kind in words.items() if row[name]])
