"""How exactly a statistic is wanted: `rms:1%` in place of a number of runs."""

from __future__ import annotations

import re
from typing import NamedTuple

from nlbench.errors import ConfigError, Problem
from nlbench.suggestions import suggestion

# What the standard error of each is a share of: the statistic itself, or for errors about zero the RMS error.
RELATIVE_TO = {
    "rms": "rms",
    "rms_clipped": "rms_clipped",
    "median_error": "median_error",
    "mean_error": "rms",
    "variance_estimated": "variance_estimated",
    "variance_actual": "variance_actual",
}
LOWEST, HIGHEST = 0.001, 50.0  # per cent
FORM = re.compile(r"\s*([^:\s]*)\s*:\s*([^%\s]+)\s*(%?)\s*")


class Precision(NamedTuple):
    """The largest standard error of a statistic at any report time, as a fraction of what `RELATIVE_TO` names."""

    statistic: str
    share: float

    def __str__(self) -> str:
        return f"{self.statistic}:{100 * self.share:g}%"


def parse(text: str, option: str = "--precision") -> Precision:
    """`rms:1%`. Raises `ConfigError` with everything that is wrong with it, and what is allowed."""
    matched = FORM.fullmatch(text)
    if matched is None:
        raise ConfigError(
            [Problem(f"expected STATISTIC:PERCENT%, such as rms:1%, found {text[:60]!r}", file=option)]
        )
    statistic, number, sign = matched.groups()
    wrong = []
    if statistic not in RELATIVE_TO:
        hint = suggestion(statistic, RELATIVE_TO)
        allowed = "" if hint.startswith("; known") else f" ({', '.join(RELATIVE_TO)})"
        wrong.append(f"no precision can be asked of '{statistic[:40]}'{hint}{allowed}")
    percent = _number(number)
    if percent is None or not LOWEST <= percent <= HIGHEST or not sign:
        found = f"{number[:40]}{sign}"
        wrong.append(
            f"expected a percentage from {LOWEST:g}% to {HIGHEST:g}%, with its sign, found '{found}'"
        )
    if wrong or percent is None:
        raise ConfigError([Problem(each, file=option) for each in wrong])
    return Precision(statistic, percent / 100)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
