"""From a file or plain data to an Experiment, or to a ConfigError that holds every problem."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nlbench.config import document as documents
from nlbench.config import overrides as settings
from nlbench.config import plugged
from nlbench.config.assemble import assemble
from nlbench.config.places import dotted, keys
from nlbench.config.schema import Experiment
from nlbench.errors import ConfigError, Problem


def load(
    path: str | os.PathLike[str],
    overrides: Sequence[str | settings.Override] = (),
    recorded: bool = False,
    check: Callable[[Experiment], None] = lambda experiment: None,
) -> Experiment:
    """The experiment in a YAML file, with overrides (`time.step=0.01`) applied in their order.

    recorded: whether the file is what a run recorded, of which plug-ins are known by name and nothing is run.
    check: looks at the experiment as well; its problems, of which it knows the keys, are placed like all others.
    Raises `ConfigError`: alone, for what cannot be read (no file, bad syntax, duplicate keys); otherwise with
    every problem of keys, values, names and their consistency, each with its place in the file or option.
    """
    document = documents.read(path)
    problems = settings.apply(document, overrides)
    with plugged.standing_in(document.data if recorded else {}):
        experiment, findings = assemble(document.data, document.question)
    problems += [document.problem(each.path, each.message, each.at_key) for each in findings]
    if problems or experiment is None:
        raise _sorted(problems)
    try:
        check(experiment)
    except ConfigError as error:
        raise _sorted([_placed(document, each) for each in error.problems]) from None
    return experiment


def _placed(document: documents.Document, problem: Problem) -> Problem:
    if problem.file or not problem.path:
        return problem
    return document.problem(keys(problem.path), problem.message)


def _sorted(problems: list[Problem]) -> ConfigError:
    return ConfigError(sorted(problems, key=lambda each: (each.line or 0, each.column or 0)))


def from_dict(data: Mapping[str, Any], question: str = "") -> Experiment:
    """The experiment in plain data with the keys of a file. Raises `ConfigError` with every problem."""
    experiment, findings = assemble(data, question)
    if experiment is None:
        raise ConfigError([Problem(each.message, dotted(each.path)) for each in findings])
    return experiment
