"""`nlbench list`: the systems, filters and experiments that there are."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from nlbench.cli import options, output
from nlbench.errors import ConfigError, printable

if TYPE_CHECKING:
    from pydantic import BaseModel

UNDECIDED = "as parameters without a default decide"  # the kind of a system that cannot be made without them


class What(StrEnum):
    """What can be listed."""

    systems = "systems"
    filters = "filters"
    experiments = "experiments"


def show(
    what: Annotated[What, typer.Argument(metavar="systems|filters|experiments", show_default=False)],
    name: Annotated[
        str | None, typer.Argument(help="One system or filter: its parameters.", show_default=False)
    ] = None,
    folder: Annotated[
        Path, typer.Option("--configs", metavar="DIR", help="Folder of the experiments.")
    ] = Path("configs"),
    plugins: options.Plugin = None,
    json: options.Json = False,
) -> None:
    """List systems, filters or experiments.

    With a NAME, the parameters of that system or the options of that filter.
    """
    if name is not None:
        _one(what, name, json)
    elif what is What.experiments:
        _experiments(folder, json)
    else:
        _all(what, json)


def _registry(what: What) -> tuple[Any, Any, Any]:
    """Names, one-line summary, and the pydantic model of the parameters for each kind of system, by the kind's name."""
    from nlbench import systems
    from nlbench.filters import catalogue

    def of_system(name: str) -> dict[str, type[BaseModel]]:
        model = systems.parameters(name)
        if any(field.is_required() for field in model.model_fields.values()):
            return {UNDECIDED: model}
        return {catalogue.KINDS[systems.kind(name, model().model_dump())]: model}

    def of_filter(name: str) -> dict[str, type[BaseModel]]:
        return {catalogue.KINDS[kind]: catalogue.options(name, *kind) for kind in catalogue.takes(name)}

    if what is What.systems:
        return systems.available(), systems.summary, of_system
    return catalogue.available(), catalogue.summary, of_filter


def _all(what: What, json: bool) -> None:
    from nlbench import plugins

    names, summary, models = _registry(what)
    names = plugins.working("systems" if what is What.systems else "filters", names)
    entries = [{"name": name, "summary": summary(name), "kinds": list(models(name))} for name in names]
    if json:
        output.as_json(entries)
        return
    groups: dict[str, list[tuple[str, str]]] = {}
    for each in entries:
        groups.setdefault(", ".join(each["kinds"]), []).append((each["name"], each["summary"]))
    for kinds, group in groups.items():
        print(output.styled(kinds if what is What.systems else f"for {kinds}", "bold"))
        output.definitions(group)
    word = "parameters" if what is What.systems else "options"
    output.next_step(f"nlbench list {what} {names[0]}", f"shows the {word} of one of them")


def _one(what: What, name: str, json: bool) -> None:
    from nlbench.suggestions import suggestion

    if what is What.experiments:
        raise ConfigError("list experiments takes no name; nlbench validate CONFIG shows one")
    names, summary, models = _registry(what)
    if name not in names:
        raise ConfigError(f"unknown {what.removesuffix('s')} '{name}'{suggestion(name, names)}")
    fields = {kind: list(_fields(model)) for kind, model in models(name).items()}
    if json:
        first, *others = fields
        apart = {kind: fields[kind] for kind in others if fields[kind] != fields[first]}
        said = {"name": name, "summary": summary(name), "kinds": list(fields)}
        output.as_json({**said, "parameters": fields[first], "parameters_of_other_kinds": apart})
        return
    print(f"{name}: {summary(name)}")
    for shown, kinds in _alike(fields):
        print(f"\n{', '.join(kinds)}")
        output.definitions((each["name"], _described(each)) for each in shown)
    entry = f"system: {{name: {name}}}" if what is What.systems else f"filters: [{name}]"
    output.next_step(
        f"write '{entry}' into an experiment file", "parameters go beside the name: {name: ..., key: value}"
    )


def _alike(fields: dict[str, list[dict[str, Any]]]) -> list[tuple[list[dict[str, Any]], list[str]]]:
    """Each list of fields, with the kinds of systems that have it."""
    found: list[tuple[list[dict[str, Any]], list[str]]] = []
    for kind, each in fields.items():
        kinds = next((kinds for known, kinds in found if known == each), None)
        if kinds is None:
            found.append((each, [kind]))
        else:
            kinds.append(kind)
    return found


def _fields(model: type[BaseModel]) -> Any:
    from nlbench.config.explain import expected, plain

    for name, field in model.model_fields.items():
        required = field.is_required()
        default = None if required else plain(field.get_default(call_default_factory=True))
        takes = expected(field.annotation, tuple(field.metadata))
        yield {
            "name": name,
            "default": default,
            "required": required,
            "takes": takes,
            "description": field.description or "",
        }


def _described(field: dict[str, Any]) -> str:
    from nlbench.config.explain import found

    default = field["default"]
    shown = found(default) if not isinstance(default, (dict, list)) else str(default)
    ending = "required" if field["required"] else f"default {shown}"
    return "; ".join(part for part in (field["description"], field["takes"], ending) if part)


def _experiments(folder: Path, json: bool) -> None:
    from nlbench.config import load

    if not folder.is_dir():
        raise ConfigError(f"no folder '{folder}' here; name one with --configs DIR")
    entries = []
    for path in sorted(folder.rglob("*.yaml")):
        try:
            entries.append({"file": str(path), "valid": True, "question": load(path).question})
        except ConfigError as error:
            count = len(error.problems)
            text = f"not valid ({count} problem{'s' if count > 1 else ''}): nlbench validate {path}"
            entries.append({"file": str(path), "valid": False, "question": text})
    if json:
        output.as_json(entries)
        return
    if not entries:
        raise ConfigError(f"no experiment (*.yaml) in '{folder}'")
    for each in entries:
        print(each["file"])
        output.definitions([("", printable(str(each["question"])))], indent=0)
    output.next_step(f"nlbench run {entries[0]['file']}", "runs the first")
