"""`nlbench new`: a commented, working skeleton of a system, a filter or an experiment, in the current folder."""

from __future__ import annotations

import keyword
import re
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError

NAME = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
# For each kind of system, (discrete, continuous): a simple filter, and one that should be better.
COMPARED = {
    (False, False): ("linearised-kalman", "third-order-guarded"),
    (True, False): ("ekf", "ukf"),
    (False, True): ("kushner-2", "kushner-3"),
}


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
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise ConfigError(f"'{name}': expected a name of a-z 0-9 _ - such as van_der_pol")
    word, dashed = name.replace("-", "_"), name.replace("_", "-")
    if what is What.experiment:
        worse, better = _compared(system, filters or [])
        listed = list(dict.fromkeys([worse, better, *(filters or [])]))
        values = {
            "NAME": dashed,
            "SYSTEM": system,
            "FILTERS": ", ".join(listed),
            "BETTER": better,
            "WORSE": worse,
        }
        path = Path(f"{word}.yaml")
    else:
        _check_free(what, dashed)
        values = {f"MY_{what.upper()}": word, f"MY-{what.upper()}": dashed}
        path = Path(f"{word}.py")
    _write(path, f"{what}{path.suffix}.txt", values)
    print(f"{path}: written")
    if what is What.experiment:
        output.next_step(options.command("run", path, None), "runs it and writes a report")
        return
    begun = f"nlbench new experiment try-{dashed} --{what} {dashed} --plugin {path}"
    output.next_step(begun, "writes an experiment with it, and says how it is run")


def _compared(system: str, filters: list[str]) -> tuple[str, str]:
    """The filters of a claim, the second expected to be better: the user's own, if one was named.

    Raises `ConfigError` for an unknown system or filter.
    """
    from nlbench import systems
    from nlbench.checks import known
    from nlbench.filters import catalogue

    known(system, systems.available(), "system")
    for each in filters:
        known(each, catalogue.available(), "filter")
    kind = systems.kind(system, systems.parameters(system)().model_dump())
    worse, better = COMPARED[kind]
    return worse, filters[0] if filters else better


def _check_free(what: What, name: str) -> None:
    """Raises `ConfigError` for a name that is a built-in system's or filter's."""
    from nlbench import systems
    from nlbench.filters.catalogue import FILTERS

    if name in (systems.MODULES if what is What.system else FILTERS):
        raise ConfigError(f"'{name}' is the name of a built-in {what}; choose another")


def _write(path: Path, skeleton: str, values: dict[str, str]) -> None:
    """Raises `ConfigError` where there is something already."""
    from nlbench.results.atomic import atomic_write

    if path.exists() or path.is_symlink():
        raise ConfigError(f"{path}: exists, and is not overwritten; choose another name or folder")
    text = files("nlbench").joinpath("skeletons", skeleton).read_text("utf-8")
    for placeholder, value in values.items():
        text = re.sub(rf"\b{placeholder}\b", value, text)
    atomic_write(path, text.encode())
