"""The JSON Schema of experiment files, for editors: names, keys, ranges and defaults as `validate` knows them.

It is looser than `validate`, which also sees whether filters fit the system, times fit each other and labels exist.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel

from nlbench import plugins, systems
from nlbench.config.assemble import MANDATORY, SECTIONS, Named
from nlbench.config.claim import Claim
from nlbench.config.schema import Experiment, Head, Initial, TimeSpec
from nlbench.filters import catalogue

Schema = dict[str, Any]
# 20_000 and 1_000.5, which YAML 1.2 and so editors read as text
DECIMAL = r"([0-9][0-9_]*(\.[0-9_]*)?|\.[0-9_]+)([eE][-+]?[0-9]+)?"
DIGITS = f"^[-+]?({DECIMAL}|0b[01_]+|0o[0-7_]+|0x[0-9a-fA-F_]+)$"


def json_schema() -> Schema:
    """The schema of a whole file (JSON Schema 2020-12)."""
    properties = _properties(Head)
    sections: dict[str, type[BaseModel]] = {**SECTIONS, "time": TimeSpec, "initial": Initial}
    for key, model in sections.items():
        properties[key] = {**_model(model), "required": []}
    properties |= {
        "system": _system(),
        "truth": {
            "type": "object",
            "description": "parameters of the system that makes the data, where it differs",
        },
        "filters": {
            "type": "array",
            "minItems": 1,
            "items": _filters(),
            "description": "the filters to compare, all on the same runs",
        },
        "claims": {
            "type": "array",
            "items": _model(Claim),
            "description": "what is expected of the filters",
        },
        "plugins": {
            "type": "array",
            "items": {"type": "object"},
            "description": "the plug-ins that a run used: written by the run, and no permission",
        },
    }
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "nlbench experiment",
        "type": "object",
        "additionalProperties": False,
        "required": list(MANDATORY),
        "properties": {
            key: properties[key] if key in MANDATORY else _or_null(properties[key])
            for key in Experiment.model_fields
            if key in properties
        },
    }
    return _with_digits(schema)


def _model(model: type[BaseModel]) -> Schema:
    """The schema of a model, with those of the models that it holds in their places: two may have one name."""
    found = model.model_json_schema()
    definitions = found.pop("$defs", {})

    def inlined(part: Any) -> Any:
        if isinstance(part, list):
            return [inlined(each) for each in part]
        if not isinstance(part, dict):
            return part
        part = dict(part)
        held = definitions[part.pop("$ref").removeprefix("#/$defs/")] if "$ref" in part else {}
        merged = {key: inlined(value) for key, value in {**held, **part}.items()}
        # The titles that pydantic makes of names say nothing; a key named title has a mapping.
        return {key: value for key, value in merged.items() if key != "title" or isinstance(value, dict)}

    return inlined(found)


def _properties(model: type[BaseModel]) -> Schema:
    return _model(model).get("properties", {})


def _entry(name: Schema, properties: Schema) -> Schema:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": ["name"],
        "properties": {"name": name, **properties},
    }


def _system() -> Schema:
    names = plugins.working("systems", systems.available())
    named = [
        _entry(
            {"const": name, "description": systems.summary(name)},
            _properties(systems.parameters(name)),
        )
        for name in names
    ]
    return {
        "description": "the system, by name, and its parameters",
        "anyOf": [{"enum": names}, *named],
    }


def _filters() -> Schema:
    """A name alone, or a mapping; one alternative for all names that take the same options."""
    common = {key: value for key, value in _properties(Named).items() if key != "name"}
    groups: dict[type[BaseModel], list[str]] = {}
    available = plugins.working("filters", catalogue.available())
    for name, model in _options(available):
        names = groups.setdefault(model, [])
        names += [name] if name not in names else []
    entries = [_entry({"enum": names}, {**_properties(model), **common}) for model, names in groups.items()]
    return {"anyOf": [{"enum": available}, *entries]}


def _options(names: Iterable[str]) -> Iterable[tuple[str, type[BaseModel]]]:
    for name in names:
        for kind in catalogue.takes(name):
            yield name, catalogue.options(name, *kind)


def _or_null(schema: Schema) -> Schema:
    """What may stand in the file without a value, as if it were left out."""
    if "type" in schema:
        return {**schema, "type": [schema["type"], "null"]}
    members = [each for each in schema["anyOf"] if each != {"type": "null"}]
    return {**schema, "anyOf": [*members, {"type": "null"}]}


def _with_digits(schema: Any) -> Any:
    """Numbers may also be digits grouped by underscores."""
    if isinstance(schema, list):
        return [_with_digits(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    found = {key: _with_digits(value) for key, value in schema.items()}
    if found.get("type") in ("integer", "number"):
        found |= {"type": [found["type"], "string"], "pattern": DIGITS}
    return found
