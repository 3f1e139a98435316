"""The filters of an experiment along recorded data, and how well they foretold them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np

from nlbench import filters, plugins, systems
from nlbench.config.schema import PARTICLES, FilterSpec
from nlbench.engine.failure import MOMENTS
from nlbench.engine.problem import overridden
from nlbench.engine.program_cache import use_cache
from nlbench.errors import ConfigError, Problem, Problems
from nlbench.filters import data
from nlbench.results.reasons import not_finite
from nlbench.samples import Pace, Ways, doubt_times, find_pace, refuse_length
from nlbench.statistics.chi_square import quantile
from nlbench.statistics.consistency import TAIL
from nlbench.systems.system import kind

if TYPE_CHECKING:
    import pandas as pd

    from nlbench.config import Experiment
    from nlbench.config.recording import Recording
    from nlbench.filters.filter import Filter

HERE = Ways("--start {}", "a longer --set time.step=")  # what a user of the command line gives


class Foretold(NamedTuple):
    """How well a filter foretold the data.

    log_likelihood: of all of them; NaN where the filter's density was not positive at one of them.
    nis: mean of z' S^-1 z over `samples` measurements; `expected` is their mean number of entries. low, high: between
    them lie 95 % of the means of a filter that is right, by chi-square; NaN where there are no bounds, because some
    updates were `altered` or `invalid` (`nlbench.filters.data.Followed`) and the others are a selection.
    lost: the first row whose estimate is not finite, or None; reason: in which part, and what was not finite.
    """

    log_likelihood: float
    nis: float
    expected: float
    low: float
    high: float
    samples: int
    altered: int
    invalid: int
    lost: int | None
    reason: str

    @property
    def verdict(self) -> str:
        """What the mean says of the covariances that the filter foretold."""
        if self.lost is not None:
            return "FAILED"
        if not math.isfinite(self.nis) or not math.isfinite(self.low):
            return "not judged"
        if self.low <= self.nis <= self.high:
            return "consistent"
        return "overconfident" if self.nis > self.high else "too cautious"


class Filtered(NamedTuple):
    """A filter's label, the table of `nlbench.filter_data`, how well it foretold the data, and what is odd of times."""

    label: str
    table: pd.DataFrame
    foretold: Foretold
    doubt: str


def bound(experiment: Experiment, labels: Sequence[str]) -> list[Filter]:
    """Those filters of the experiment, each on the system that it believes in, with its step and initial moments.

    Raises `ConfigError` with every problem there is.
    """
    plugins.restore(experiment.plugins)
    made, problems = [], Problems()
    for number, spec in enumerate(_specs(experiment)):
        at = f"filters.{number}" if number < len(experiment.filters) else "reference"
        if spec.label in labels:
            with problems.of(at):
                made.append(_bound(experiment, spec, at))
    problems.refuse()
    return made


def filtered(
    experiment: Experiment, labels: Sequence[str], recording: Recording, start: float = 0.0
) -> Iterator[Filtered]:
    """What each of those filters says along the recording, from its initial moments at `start`.

    Raises `ConfigError` before anything is computed where the recording does not fit the filters.
    """
    made = bound(experiment, labels)
    times = np.array(recording.times)
    y = np.array(recording.values).reshape(len(times), -1)
    problems = [each for label, f in zip(labels, made, strict=True) for each in _misfit(label, f, recording)]
    refused = refuse_length(times, start, _pace(made), HERE)
    problems += [Problem(refused, file=recording.file)] if refused else []
    if problems:
        raise ConfigError(problems)
    doubt = doubt_times(times, start, _pace(made), HERE)
    use_cache()
    key = jax.random.key(experiment.monte_carlo.seed)
    for label, f in zip(labels, made, strict=True):
        followed = data.follow(f, times, y, start, key)
        yield Filtered(label, data.table(f, followed, recording.names), foretold(followed), doubt)


def foretold(followed: data.Followed) -> Foretold:
    """The summary of what a filter said."""
    unfair = followed.altered | followed.invalid
    fair = (followed.taken > 0) & ~unfair
    samples = int(fair.sum())
    degrees = float(followed.taken[fair].sum())
    expected = degrees / samples if samples else math.nan
    low = high = math.nan
    if samples and not unfair.any():
        low, high = (quantile(tail, np.array([degrees])).item() / samples for tail in (TAIL, 1 - TAIL))
    wrong = followed.wrong[:, 1].any(1)
    lost = int(wrong.argmax()) if wrong.any() else None
    return Foretold(
        log_likelihood=float(followed.log_likelihood.sum()),
        nis=float(followed.nis[fair].mean()) if samples else math.nan,
        expected=expected,
        low=low,
        high=high,
        samples=samples,
        altered=int(followed.altered.sum()),
        invalid=int(followed.invalid.sum()),
        lost=lost,
        reason="" if lost is None else _reason(followed.wrong[lost]),
    )


def _reason(wrong: np.ndarray) -> str:
    """Say in which part, and what, first was not finite; wrong: (2, 2), as in `nlbench.filters.data.Followed`."""
    part = int(wrong.any(1).argmax())
    names = [name for name, bad in zip(MOMENTS, wrong[part], strict=False) if bad]
    return f"in the {('propagation', 'update')[part]}: {not_finite(names)}"


def _specs(experiment: Experiment) -> list[FilterSpec]:
    """The filters, and the reference, which believes in what makes the data."""
    label = experiment.reference_label
    if label is None:
        return experiment.filters
    large = experiment.reference == "particles"
    name, options = ("bootstrap", {"particles": PARTICLES}) if large else ("exact", {})
    return [*experiment.filters, FilterSpec(name=name, label=label, options=options, model=experiment.truth)]


def _bound(experiment: Experiment, spec: FilterSpec, at: str) -> Filter:
    system = systems.build(experiment.system.name, **{**experiment.system.parameters, **spec.model})
    if getattr(system, "sightings", None):
        raise ConfigError(
            f"{spec.label}: the system is measured at angles, and recorded data have times only"
        )
    problems = Problems()
    with problems.of(at):
        initial = overridden(system.initial, experiment.initial, spec.initial, at)
        system = replace(system, initial=initial)
    options: dict[str, Any] = dict(spec.options)
    if "missing" in options:
        options["missing"] = True
    if not kind(system).discrete and "step" in options:
        options["step"] = options["step"] or experiment.time.step
    with problems.of(at):
        f = filters.build(spec.name, system, **options)
    problems.refuse()
    return f


def _misfit(label: str, f: Filter, recording: Recording) -> Iterator[Problem]:
    m, names = f.system.measurements, recording.names
    if m != len(names):
        found = f"{len(names)} measured column{'s' if len(names) > 1 else ''} ({', '.join(names)})"
        hint = "; name those that it measures with --measured" if len(names) > m else ""
        yield Problem(f"{found}, but the system of '{label}' measures {m}{hint}", file=recording.file, line=1)


def _pace(made: Sequence[Filter]) -> Pace:
    """The shortest steps of all filters."""
    paces = [find_pace(f) for f in made]
    return paces[0]._replace(step=min((each.step for each in paces if each.step), default=None))
