"""What a notebook needs: runs whose results show themselves and draw their figures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nlbench.errors import ConfigError, NlbenchError
from nlbench.results import results
from nlbench.suggestions import suggestion

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Results(results.Results):
    """A finished run, from its folder.

    `table(name)`, `tables`, `claims`, `plot()`, `report()`, `manifest`, `experiment`, `path` are what it has. At the
    end of a notebook's cell it shows itself: errors with standard errors, diverged runs, verdicts.
    """

    def __repr__(self) -> str:
        try:
            runs, labels = self.manifest["runs"], ", ".join(self.experiment.labels)
        except NlbenchError:  # damaged, or of another version; whatever reads it says so
            return super().__repr__()
        return f"Results({str(self.path)!r}): {runs:,} runs of {labels}"

    def _repr_html_(self) -> str:
        from nlbench import report

        return report.brief(self)

    @property
    def claims(self) -> pd.DataFrame | None:
        """The verdict on each claim; None where the experiment makes none."""
        return self.table("claims") if "claims" in self.tables else None

    def report(self) -> Path:
        """Draw all figures and write `report.html`, one page that needs no network. Returns its path."""
        from nlbench import report

        return report.write(self)

    def plot(
        self, kind: str = "rms", coordinate: str | None = None, filters: Sequence[str] | None = None
    ) -> Figure:
        """A figure of the report: `kind` is one of those that an experiment's `figures` takes.

        coordinate: default, the first that there is. filters: labels of those to draw; default, all.
        Raises `ConfigError` for an unknown name, and where the run has no such figure.
        """
        from nlbench import figures

        if kind not in figures.FIGURES:
            raise ConfigError(f"unknown figure '{kind}'{suggestion(kind, figures.FIGURES)}")
        for label in filters or ():
            if label not in self.experiment.labels:
                raise ConfigError(
                    f"no filter is labelled '{label}'{suggestion(label, self.experiment.labels)}"
                )
        return figures.one(self, kind, coordinate, filters)


def run(
    experiment: Any, out: Any = None, progress: Any = None, check: Any = None, dask: str | None = None
) -> Results:
    """Run an experiment, or go on with one that was stopped, and return its `Results`.

    experiment: an `Experiment`, a path of an experiment file, or a dict with the keys of one, whose `system` may be a
        `System` or `DiscreteSystem` of your own.
    out: folder of results (default "results"). progress: called with (runs done, runs in all). check: called before
        anything is computed, and may raise (`nlbench.engine.planning.space.require` where room is short).
    dask: compute with the workers of a dask scheduler, "tcp://HOST:PORT", or with "local:N" processes.
    Raises `ConfigError` before anything is computed, `LockedError` where another process runs the same experiment,
    `EnvironmentFault` for disk and memory, `Interrupted` after Ctrl-C with everything so far saved.
    """
    from nlbench import engine

    return Results(Path(engine.run(experiment, out, progress, check, dask).path))
