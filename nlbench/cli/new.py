"""`nlbench new`: a commented, working skeleton of a system, a filter or an experiment, in the current folder."""

from __future__ import annotations

import ast
import builtins
import keyword
import re
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError, Problem

if TYPE_CHECKING:
    from pydantic import BaseModel

NAME = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")  # of what becomes a function of Python
BASELINE = "no-filter"  # what any filter should be better than
# For each kind of system, (discrete, continuous): a simple filter, and one that should be better.
COMPARED = {
    (False, False): ("linearised-kalman", "third-order-guarded"),
    (True, False): ("ekf", "ukf"),
    (False, True): ("kushner-2", "kushner-3"),
}
UNDECIDED = ("ekf", "ukf")  # where the kind depends on parameters that have no default
NO_TEXT = ("null", "true", "false")  # as a value in YAML


class What(StrEnum):
    """What can be begun."""

    system = "system"
    filter = "filter"
    experiment = "experiment"


def new(
    what: Annotated[What, typer.Argument(metavar="system|filter|experiment", show_default=False)],
    name: Annotated[str, typer.Argument(help="Its name, such as van_der_pol.", show_default=False)],
    system: Annotated[
        str, typer.Option("--system", metavar="NAME", help="Of an experiment: its system.")
    ] = "culver-scalar",
    filters: Annotated[
        list[str] | None,
        typer.Option("--filter", metavar="NAME", help="Of an experiment: one more filter; repeatable."),
    ] = None,
    plugins: options.Plugin = None,
) -> None:
    """Write a commented, working skeleton into the current folder.

    A system or filter becomes NAME.py, an experiment NAME.yaml. What is there already is never overwritten.
    """
    capitals = what is What.experiment
    if not NAME.fullmatch(name.lower() if capitals else name) or keyword.iskeyword(name):
        letters = "A-Z a-z" if capitals else "a-z"
        raise ConfigError(f"'{name}': expected a name of {letters} 0-9 _ - such as van_der_pol")
    word, dashed = name.replace("-", "_"), name.replace("_", "-")
    if what is What.experiment:
        _experiment(Path(f"{word}.yaml"), dashed, system, filters or [])
        return
    path = Path(f"{word}.py")
    _check_free(what, word, dashed)
    _write(path, f"{what}.py.txt", {f"MY_{what.upper()}": word, f"MY-{what.upper()}": dashed})
    print(f"{path}: written")
    begun = f"nlbench new experiment try-{dashed} --{what} {dashed} --plugin {path}"
    output.next_step(begun, "writes an experiment with it, and says how it is run")


def _experiment(path: Path, name: str, system: str, filters: list[str]) -> None:
    """Write an experiment that is valid, or says what must be written into it first."""
    from nlbench import systems
    from nlbench.filters import catalogue

    if name.lower() in NO_TEXT:
        raise ConfigError(f"'{name}': means something else in YAML; choose another name")
    kind = _kind(system)
    worse, better = _compared(kind, filters)
    listed = list(dict.fromkeys([worse, better, *filters]))
    options_of = [(each, catalogue.options(each, *(kind or ()))) for each in listed]
    values = {"NAME": name, "SYSTEM": system, "FILTERS": ", ".join(listed), "BETTER": better, "WORSE": worse}
    values["SYSTEM_NEEDS"] = _needs([(system, systems.parameters(system))])
    values["FILTERS_NEED"] = _needs(options_of)
    _write(path, "experiment.yaml.txt", values)
    print(f"{path}: written")
    if values["SYSTEM_NEEDS"] or values["FILTERS_NEED"]:
        validate = options.command("validate", path, None)
        output.next_step(validate, "says what is missing; write that into the file first")
    else:
        output.next_step(options.command("run", path, None), "runs it and writes a report")


def _kind(system: str) -> tuple[bool, bool] | None:
    """The kind of a system; None where parameters without a default decide it. Raises `ConfigError`."""
    from nlbench import systems
    from nlbench.checks import known

    model = systems.parameters(known(system, systems.available(), "system"))
    if any(field.is_required() for field in model.model_fields.values()):
        return None
    return systems.kind(system, model().model_dump())


def _compared(kind: tuple[bool, bool] | None, filters: list[str]) -> tuple[str, str]:
    """The filters of a claim, the second expected to be better: the user's own, if one was named.

    Raises `ConfigError` for a filter that is unknown or not for systems of the kind.
    """
    from nlbench.checks import known
    from nlbench.filters import catalogue

    problems = []
    for each in filters:
        known(each, catalogue.available(), "filter")
        refused = kind and catalogue.refusal(each, *kind)
        problems += [Problem(f"'{each}' {refused}", file="--filter")] if refused else []
    if problems:
        raise ConfigError(problems)
    worse, better = COMPARED[kind] if kind else UNDECIDED
    better = next((each for each in filters if each != BASELINE), better)
    rows = [catalogue.row(each, *(kind or ())) for each in (worse, better)]
    alike = len({(row.order, row.update, row.options, row.family) for row in rows}) == 1
    return BASELINE if alike else worse, better


def _needs(named: list[tuple[str, type[BaseModel]]]) -> str:
    """A comment on what has no default; nothing where all has one."""
    from nlbench.config.explain import expected

    missing = [
        f"{name} needs {key} ({expected(field.annotation, tuple(field.metadata))})"
        for name, model in named
        for key, field in model.model_fields.items()
        if field.is_required()
    ]
    return f"  # not valid yet: {'; '.join(missing)}" if missing else ""


def _check_free(what: What, word: str, dashed: str) -> None:
    """Raises `ConfigError` for a name of a built-in system or filter, and for one that the skeleton's code uses."""
    from nlbench import systems
    from nlbench.filters.catalogue import FILTERS

    if dashed in (systems.MODULES if what is What.system else FILTERS):
        raise ConfigError(f"'{dashed}' is the name of a built-in {what}; choose another")
    tree = ast.parse(_skeleton(f"{what}.py.txt"))
    imports = [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]
    imported = [alias.asname or alias.name for node in imports for alias in node.names]
    if word in (*imported, *dir(builtins)):
        raise ConfigError(f"'{word}' is a name that the code of the skeleton uses; choose another")


def _skeleton(name: str) -> str:
    return files("nlbench").joinpath("skeletons", name).read_text("utf-8")


def _write(path: Path, skeleton: str, values: dict[str, str]) -> None:
    """Raises `ConfigError` where there is something already."""
    from nlbench.results.atomic import atomic_write

    same = [each.name for each in Path().iterdir() if each.name.casefold() == path.name.casefold()]
    if same:
        raise ConfigError(f"{same[0]}: exists, and is not overwritten; choose another name or folder")
    text = _skeleton(skeleton)
    for placeholder, value in values.items():
        text = re.sub(rf"\b{placeholder}\b", value.replace("\\", r"\\"), text)
    atomic_write(path, text.encode())
