"""Tables of a source that need no runs: they are calculated again, and compared."""

from __future__ import annotations

from collections.abc import Callable

from nlbench.reproduce import posterior
from nlbench.reproduce.verdicts import DIFFERS, REPRODUCED, Verdict

ORDERS = (2, 3, 4)
# Culver 1969, table 6.1: words for a filter of each order in five dimensions, all moments stored or unique ones only.
PRINTED_STORAGE = {"all": (30, 155, 780), "unique": (20, 55, 125)}
DIMENSION = 5
SHAPES = ((1, 1), (2, 1), (3, 2))  # states and measurements of the updates that are compared
CLOSE = 1e-9  # relative, in float64: sums of some hundred terms


def moment_storage() -> Verdict:
    """Table 6.1 against the number of components that moments have here."""
    from nlbench.algebra import compact_indices

    unique = [len(compact_indices(DIMENSION, order)) for order in range(1, ORDERS[-1] + 1)]
    counted = {
        "all": tuple(sum(DIMENSION**power for power in range(1, order + 1)) for order in ORDERS),
        "unique": tuple(sum(unique[:order]) for order in ORDERS),
    }
    wrong = [f"{name}: {counted[name]}" for name in counted if counted[name] != PRINTED_STORAGE[name]]
    if wrong:
        return Verdict(DIFFERS, f"Counted otherwise here, {'; '.join(wrong)}.", "Nothing: it is a count.")
    printed = " and ".join(", ".join(map(str, each)) for each in PRINTED_STORAGE.values())
    return Verdict(
        REPRODUCED,
        f"All six numbers printed for five dimensions, {printed}, are those of the moments that are stored here.",
        "Nothing: it is a count.",
    )


def updating_equations() -> Verdict:
    """Table 5.1, as the filter `third-order` computes it, against Bayes' rule by quadrature that is exact."""
    worst = max(posterior.error(posterior.example(n, r, seed)) for n, r in SHAPES for seed in range(3))
    change = "Nothing: they are equations, and the quadrature is exact."
    shapes = ", ".join(f"{n} by {r}" for n, r in SHAPES)
    text = f"the equations and Bayes' rule by exact quadrature differ by {worst:.1e} at most, relative to the moment"
    text += f" ({shapes} states and measurements, three of each)."
    return Verdict(REPRODUCED if worst < CLOSE else DIFFERS, text[0].upper() + text[1:], change)


CHECKS: dict[str, Callable[[], Verdict]] = {
    "moment-storage": moment_storage,
    "updating-equations": updating_equations,
}
