"""What `nlbench filter` is given: experiment, recorded data and options, checked before anything heavy is loaded."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from nlbench.cli import options
from nlbench.errors import ConfigError, Problem

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.config.recording import Recording


def read(
    config: Path, seed: str | None, settings: list[str] | None, data: Path, time: str, names: list[str] | None
) -> tuple[Experiment, Recording]:
    """Both files. Raises `ConfigError` with everything that is wrong with either."""
    from nlbench import systems
    from nlbench.config import recording

    problems: list[Problem] = []
    experiment, found, discrete = None, None, False
    try:
        experiment = options.experiment(config, None, seed, settings, computes=False)
        discrete, continuous = systems.kind(experiment.system.name, experiment.system.parameters)
        if continuous:
            message = "the system is measured continuously, and recorded data at times"
            problems.append(Problem(message, "system.measurement", str(config)))
    except ConfigError as error:
        problems += error.problems
    try:
        found = recording.read(data, time, names, whole=discrete)
    except ConfigError as error:
        problems += error.problems
    if problems or experiment is None or found is None:
        raise ConfigError(problems)
    return experiment, found


def chosen(experiment: Experiment, labels: list[str] | None) -> list[str]:
    """Labels of the filters that are asked for, in the order of the file; all where none is."""
    from nlbench.suggestions import suggestion

    known = experiment.labels
    unknown = [label for label in labels or () if label not in known]
    if unknown:
        says = "no filter is labelled '{}'{}"
        problems = [
            Problem(says.format(label, suggestion(label, known)), file="--filter") for label in unknown
        ]
        raise ConfigError(problems)
    return [label for label in known if not labels or label in labels]


def check_start(experiment: Experiment, recording: Recording, start: float, time: str) -> None:
    """Raises `ConfigError` where the filters cannot start at `start`."""
    from nlbench import systems

    discrete = systems.kind(experiment.system.name, experiment.system.parameters).discrete
    if not math.isfinite(start) or (discrete and not start.is_integer()):
        kind = "a step number, since the system's time is discrete" if discrete else "a finite number"
        raise ConfigError([Problem(f"expected {kind}, found {start:g}", file="--start")])
    first = recording.times[0]
    if first < start:
        message = f"{first!r} comes before the start, {start!r}; --start T says when the filters start"
        raise ConfigError([Problem(message, time, recording.file, recording.lines[0])])


def check_out(out: Path | None, *inputs: Path) -> None:
    """Raises `ConfigError` for a file that cannot be meant."""
    if out is None:
        return
    if out.is_dir():
        raise ConfigError([Problem(f"{out} is a folder; expected a file", file="--out")])
    if out.exists() and any(out.samefile(each) for each in inputs):
        raise ConfigError([Problem(f"would overwrite {out}, which is read", file="--out")])
