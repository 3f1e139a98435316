"""The test of a claim in words, such as `rms_clipped of x at 1, 2: third-order < second-order`."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlbench.config import Claim, Experiment


def in_words(claim: Claim, experiment: Experiment) -> str:
    """What is compared with what, where and when."""
    of = f" of {claim.coordinate}" if claim.coordinate else ""
    times = ", ".join(f"{time:g}" for time in claim.at or experiment.report_times)
    return f"{claim.statistic}{of} at t = {times}: {_comparison(claim)}"


def _comparison(claim: Claim) -> str:
    labels, constant = claim.labels, f"{claim.factor:g} × " if claim.factor else ""
    match claim.form:
        case "less":
            chain = (
                "; ".join(f"{constant}{a} < {b}" for a, b in pairwise(labels))
                if constant
                else " < ".join(labels)
            )
            return f"relative distance to {claim.agrees_with}: {chain}" if claim.agrees_with else chain
        case "equal":
            return f"{' = '.join(labels)} within {100 * (claim.within or 0):g} %"
        case "agrees_with":
            return f"of {_each(labels)}, within {100 * (claim.within or 0):g} % of {claim.agrees_with}"
        case "less_than":
            return f"of {_each(labels)}, {constant}itself < {claim.less_than}"
        case "printed":
            numbers = ", ".join(f"({key}) {value:g}" for key, value in (claim.printed or {}).items())
            return f"of {_each(labels)}, as printed: {numbers}"
        case _:
            bounds = [f"> {claim.above:g}"] if claim.above is not None else []
            bounds += [f"< {claim.below:g}"] if claim.below is not None else []
            return f"of {_each(labels)}, {' and '.join(bounds)}"


def _each(labels: list[str]) -> str:
    return labels[0] if len(labels) == 1 else f"each of {', '.join(labels)}"
