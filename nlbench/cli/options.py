"""Arguments and options that several commands share, and the experiment that they state."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from nlbench.config import Experiment
    from nlbench.config.precision import Precision as PrecisionAsked

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Experiment file (YAML).", show_default=False)]
Where = Annotated[
    Path,
    typer.Argument(
        metavar="FOLDER|CONFIG", help="Folder of a run, or its experiment file.", show_default=False
    ),
]
Runs = Annotated[
    str | None,
    typer.Option("--runs", metavar="N", help="Number of runs instead of the file's (1e5 will do)."),
]
Seed = Annotated[str | None, typer.Option("--seed", metavar="S", help="Seed instead of the file's.")]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Any value of the file: --set time.step=0.01; repeatable."
    ),
]
Out = Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder of all results.")]
Precision = Annotated[
    str | None,
    typer.Option(
        "--precision", metavar="WHAT:P%", help="Choose the runs: rms:1% is a standard error of 1 % of each."
    ),
]
Gate = Annotated[bool, typer.Option("--gate", help="Exit with 3 unless every claim is confirmed.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON for programs.")]


def _allow(paths: list[Path] | None) -> list[Path] | None:
    """Have exactly these plug-ins; called before the command."""
    from nlbench import plugins

    plugins.forget()
    if paths:
        from nlbench.config import allow

        allow(*paths)
    return paths


# Only what stands here is allowed to run, so a command need not look at it again.
Plugin = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE.py",
        callback=_allow,
        is_eager=True,
        help="Run this Python file, for the systems and filters that it declares; repeatable.",
    ),
]


def experiment(
    config: Path, runs: str | None, seed: str | None, settings: list[str] | None, computes: bool = True
) -> Experiment:
    """The experiment in the file with the options of the command line put in.

    computes: whether its systems and filters must fit each other, and not only be named.
    Raises `ConfigError`.
    """
    from nlbench.config import Override, load

    overrides: list[str | Override] = list(settings or [])
    if runs is not None:
        overrides.append(Override("monte_carlo.runs", runs, "--runs"))
    if seed is not None:
        overrides.append(Override("monte_carlo.seed", seed, "--seed"))
    return load(config, overrides, check=_made if computes else _tried)


def _made(experiment: Experiment) -> None:
    from nlbench import engine

    engine.check(experiment)


def _tried(experiment: Experiment) -> None:
    if experiment.plugins:  # code that nobody has tried yet
        _made(experiment)


def precision(text: str | None, runs: str | None) -> PrecisionAsked | None:
    """The precision asked for. Raises `ConfigError` for a bad one, and where --runs is given as well."""
    from nlbench.config.precision import parse
    from nlbench.errors import ConfigError

    if text is not None and runs is not None:
        raise ConfigError("--precision chooses the number of runs, --runs gives it: leave one out")
    return None if text is None else parse(text)


def fractions(given: Mapping[str, str]) -> list[float]:
    """The values of options that are numbers or percentages: 0.15 or 15%. Raises `ConfigError` for all that are not."""
    from nlbench.errors import ConfigError, Problem

    values, wrong = [], []
    for option, text in given.items():
        number = text.strip()
        try:
            values.append(float(number.removesuffix("%")) / (100 if number.endswith("%") else 1))
        except ValueError:
            message = f"expected a number or a percentage such as 1%, found '{text}'"
            wrong.append(Problem(message, file=option))
    if wrong:
        raise ConfigError(wrong)
    return values


def words(given: Mapping[str, str | None]) -> list[str]:
    """Options with their values as the words of a command line, without those that are not given."""
    return [word for name, value in given.items() if value is not None for word in (name, value)]


def command(name: str, config: Path, settings: list[str] | None, *options: str) -> str:
    """A command line that the user can paste: the same file and settings, another command."""
    import shlex

    from nlbench import plugins

    line = ["nlbench", name, str(config), *options]
    for path in plugins.files():
        line += ["--plugin", path]
    for each in settings or []:
        line += ["--set", each]
    return shlex.join(line)
