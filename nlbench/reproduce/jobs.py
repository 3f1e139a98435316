"""Which experiments a selection of figures needs, and where their results will lie."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from nlbench.errors import ConfigError
from nlbench.reproduce import documents
from nlbench.suggestions import suggestion

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.reproduce.documents import Error, Item, Source

QUICK_RUNS = 2048  # 32 blocks of 64: as many groups as the jackknife needs
DEAR_RUNS = 320  # five blocks, where a reference on a grid takes tens of milliseconds a run


class Chosen(NamedTuple):
    """What is to be reproduced: entries by source, and the errata of these sources."""

    entries: tuple[tuple[Source, tuple[Item, ...]], ...]
    errors: tuple[Error, ...]

    @property
    def experiments(self) -> tuple[str, ...]:
        """Names of the experiments that they need, in order, each once."""
        of_entries = [name for _, items in self.entries for item in items for name in item.experiments]
        of_errors = [name for error in self.errors for name in error.experiments]
        return tuple(dict.fromkeys([*of_entries, *of_errors]))

    def figures(self, experiment: str) -> tuple[str, ...]:
        """The kinds of figures of which the entries show pictures of this experiment."""
        items = [item for _, items in self.entries for item in items if experiment in item.experiments]
        return tuple(dict.fromkeys(name.split("-")[0] for item in items for name in item.pictures))


class Job(NamedTuple):
    """One experiment to run: its file and settings of this call, what they say, how many runs, and the folder of its
    results."""

    name: str
    file: Path
    settings: tuple[str, ...]
    experiment: Experiment
    runs: int
    folder: Path

    @property
    def work(self) -> float:
        """A rough measure of the time it takes: the longest should begin first."""
        time = self.experiment.time
        return self.runs * time.end / time.step * (len(self.experiment.filters) + 1)


def choose(source: str | None = None, figure: str | None = None) -> Chosen:
    """The entries of a source (`culver`, `culver-1969`; default: all), or one of them (`7.18`, `table 8.1`).

    Errata belong to whole sources: for a single figure there are none. Raises `ConfigError` for an unknown name.
    """
    names = [name for name in documents.NAMES if source in (None, name, name.split("-")[0])]
    if not names:
        raise ConfigError(f"unknown source '{source}'{suggestion(str(source), documents.NAMES)}")
    found = [documents.source(name) for name in names]
    if figure is None:
        errors = tuple(error for error in documents.errors() if error.document in names)
        return Chosen(tuple((each, each.entries) for each in found), errors)
    named = [(each, tuple(item for item in each.entries if _is(item, figure))) for each in found]
    chosen = tuple((each, items) for each, items in named if items)
    if not chosen:
        known = sorted({item.number for each in found for item in each.entries})
        raise ConfigError(f"--figure: no source has a '{figure}'{suggestion(figure, known)}")
    return Chosen(chosen, ())


def _is(item: Item, wanted: str) -> bool:
    return wanted.casefold() in (item.number.casefold(), f"{item.kind} {item.number}".casefold())


def jobs(chosen: Chosen, configs: Path, out: Path, quick: bool = False) -> list[Job]:
    """The jobs of all that is chosen. Raises `ConfigError` with all that is wrong with the files.

    quick: no experiment makes more than `QUICK_RUNS`, or `DEAR_RUNS` where the exact line is dear; costs are not
    measured, and only those figures are drawn that entries show, since both take longer than so few runs. Otherwise
    as the files say.
    """
    from nlbench.config import load

    found, problems = [], []
    if not configs.is_dir():
        raise ConfigError(
            f"no folder '{configs}' here; name the folder of the experiments with --configs DIR"
        )
    for name in chosen.experiments:
        file = configs / f"{name}.yaml"
        settings = (f"figures=[{', '.join(chosen.figures(name))}]", "engine.cost=false") if quick else ()
        try:
            experiment = load(file, settings)
        except ConfigError as error:
            problems += error.problems
            continue
        runs = experiment.monte_carlo.runs
        folder = experiment.folder(out)
        runs = min(runs, _quick_runs(experiment)) if quick else runs
        found.append(Job(name, file, settings, experiment, runs, folder))
    if problems:
        raise ConfigError(problems)
    return found


def _quick_runs(experiment: Experiment) -> int:
    """How many runs are quick. Schwartz's exact line solves Zakai's equation on a grid in every run."""
    dear = experiment.system.name == "schwartz" and experiment.reference == "exact"
    return DEAR_RUNS if dear else QUICK_RUNS
