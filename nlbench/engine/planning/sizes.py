"""Bytes of what a run keeps: its totals, and the files it leaves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nlbench.results.tables import PARQUET_ONLY, csv_bytes, parquet_bytes
from nlbench.statistics.kept import Reported

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.engine.compiled import Compiled
    from nlbench.statistics.layout import Layout
    from nlbench.statistics.totals import Totals

KEPT = "runs"  # the one table that grows with the runs
ARRAY_BYTES = 270  # in the file of a checkpoint: its name, twice, and the headers of NumPy and of the archive
# Of a picture as SVG, PNG and inside the report: measured on eight experiments of this repository.
PICTURE_BYTES, POINT_BYTES = 230_000, 470


def program(compiled: Compiled) -> dict[str, int]:
    """Bytes that XLA gives: of the code, and of one call's arguments, results and working memory."""
    analysis = compiled.executables[0].memory_analysis()
    return {
        "code": analysis.generated_code_size_in_bytes,
        "argument": analysis.argument_size_in_bytes,
        "output": analysis.output_size_in_bytes,
        "temp": analysis.temp_size_in_bytes,
    }


def state(totals: Totals, runs: int) -> int:
    """Bytes of the totals after so many runs, from those of some runs."""
    saved = totals.state()
    kept = sum(saved[f"kept_{name}"].nbytes for name in Reported._fields)
    rest = sum(array.nbytes for array in saved.values()) - kept
    return rest + totals.kept.bytes_of_a_run * min(runs, totals.kept.capacity)


def checkpoint(totals: Totals, runs: int) -> int:
    """Bytes of the file that holds them."""
    return state(totals, runs) + ARRAY_BYTES * len(totals.state())


def most_state(totals: Totals, compiled: Compiled, runs: int) -> int:
    """The same before any run: at most as much as a call returns, whose blocks are as many as there are groups."""
    fixed = totals.pivot.nbytes + totals.histogram.nbytes + program(compiled)["output"]
    return fixed + totals.kept.bytes_of_a_run * min(runs, totals.kept.capacity)


def written(tables: dict[str, pd.DataFrame]) -> dict[str, int]:
    """Bytes of each table as the files that are made of it."""
    return {
        name: len(parquet_bytes(table)) + (0 if name in PARQUET_ONLY else len(csv_bytes(table)))
        for name, table in tables.items()
    }


def pictures(experiment: Experiment, layout: Layout, diverged: bool) -> int:
    """How many pictures a report has; densities and responses are as many as report times and traces."""
    coordinates, magnitudes, reports = len(layout.coordinates), len(layout.magnitudes), len(layout.reports)
    many = {
        "rms": magnitudes,
        "rms_clipped": magnitudes if diverged else 0,
        "mean_error": coordinates,
        "variance": coordinates,
        "third_moment": coordinates,
        "nees": 1,
        "divergence": int(diverged),
        "trace": len(experiment.traces),
        "cost": 1,
    }
    asked = {
        "density": coordinates * reports,
        "response": len(experiment.traces),
        "final": magnitudes,
    }
    if experiment.figures is None:
        return sum(many.values())
    return sum({**many, **asked}[name] for name in experiment.figures)


def drawn(count: int, layout: Layout) -> int:
    """Bytes of so many pictures with a curve for each filter, in their files and in the report."""
    return count * (PICTURE_BYTES + POINT_BYTES * len(layout.filters) * len(layout.times))
