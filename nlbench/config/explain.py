"""Validation by pydantic whose findings say what is expected, in which range, and what was found."""

from __future__ import annotations

import json
import math
import types
from collections.abc import Iterable, Iterator
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from nlbench.config.nodes import INTEGRAL
from nlbench.config.places import Path
from nlbench.suggestions import closest, suggestion

Model = TypeVar("Model", bound=BaseModel)
# Magnitudes of numbers other than 0, so that squares, cubes and quotients of them stay in double precision.
SMALLEST, LARGEST = 1e-100, 1e100
KINDS = {int: "a whole number", float: "a number", str: "text", bool: "true or false", type(None): "null"}


class Finding(NamedTuple):
    """Something wrong at a path of the data; `at_key` when the key, not its value, is to be shown."""

    path: Path
    message: str
    at_key: bool = False


def validated(model: type[Model], raw: Any, at: Path = ()) -> tuple[Model | None, list[Finding]]:
    """`raw` as an instance of `model`, or None, and everything that is wrong with it, placed below `at`.

    Strict: no text for a number, no true for 1. An integer is a number, and 1e6 is an integer.
    """
    if not isinstance(raw, dict):
        return None, [
            Finding(at, f"expected a mapping ({', '.join(model.model_fields)}), found {found(raw)}")
        ]
    raw = plain(raw)
    instance, findings = _parsed(model, raw)
    unknown = [
        each.path[0] for each in findings if each.at_key and len(each.path) == 1 and each.path[0] in raw
    ]
    if unknown and len(unknown) == len(findings):  # else nothing looks at fields together
        findings += _parsed(model, {key: value for key, value in raw.items() if key not in unknown})[1]
    told = {each.path for each in findings}
    findings += [each for each in _extremes(raw, ()) if each.path not in told]
    return None if findings else instance, [each._replace(path=(*at, *each.path)) for each in findings]


def _parsed(model: type[Model], raw: dict[str, Any]) -> tuple[Model | None, list[Finding]]:
    try:
        return model.model_validate_json(json.dumps(raw), strict=True), []
    except ValidationError as error:
        return None, list(_findings(model, raw, error))


def sound(model: type[Model], raw: Any, findings: Iterable[Finding], at: Path = ()) -> Model:
    """What of `raw`, placed at `at`, is right: an instance that may lack some of it.

    None stands for every value that a finding is about or that is missing, entries of lists included.
    """
    raw = plain(raw) if isinstance(raw, dict) else {}
    wrong = {each.path for each in findings}

    def right(value: Any, path: Path) -> Any:
        if path in wrong:
            return None
        if isinstance(value, list):
            return [right(each, (*path, index)) for index, each in enumerate(value)]
        return value

    def default(field: Any) -> Any:
        return None if field.is_required() else field.get_default(call_default_factory=True)

    fields = {
        key: right(raw[key], (*at, key)) if key in raw else default(field)
        for key, field in model.model_fields.items()
    }
    return model.model_construct(**fields)


def plain(value: Any) -> Any:
    """The data as dict, list, str, int, float, bool and None; numbers without a fraction are integers."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, BaseModel):
        return plain(value.model_dump(mode="json"))
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and abs(value) < INTEGRAL and value.is_integer():
        return int(value)
    return value


def found(value: Any) -> str:
    """A value as the user would recognise it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:56]} ..."


def expected(annotation: Any, metadata: tuple[Any, ...] = ()) -> str:
    """What values a field takes, with their range: `a whole number of at least 1`."""
    origin, members = get_origin(annotation), get_args(annotation)
    metadata = tuple(bound for each in metadata for bound in getattr(each, "metadata", (each,)))
    if origin is Annotated:
        return expected(members[0], (*members[1:], *metadata))
    if origin in (Union, types.UnionType):
        return " or ".join(expected(member, () if member is type(None) else metadata) for member in members)
    if origin is Literal:
        *others, last = [repr(member) for member in members]
        return f"{', '.join(others)} or {last}" if others else last
    if annotation in KINDS:
        return KINDS[annotation] + (
            _range(metadata) if annotation in (int, float) else _length(metadata, "characters")
        )
    if origin in (list, tuple) or annotation in (list, tuple):
        return "a list" + _length(metadata, "entries")
    return "a mapping"


def _range(metadata: tuple[Any, ...]) -> str:
    bounds = {
        name: getattr(each, name)
        for each in metadata
        for name in ("ge", "gt", "le", "lt")
        if _has(each, name)
    }
    bounds = {name: f"{plain(bound):,}" for name, bound in bounds.items()}
    low = f"at least {bounds['ge']}" if "ge" in bounds else f"above {bounds['gt']}" if "gt" in bounds else ""
    high = f"at most {bounds['le']}" if "le" in bounds else f"below {bounds['lt']}" if "lt" in bounds else ""
    if "ge" in bounds and "le" in bounds:
        return f" from {bounds['ge']} to {bounds['le']}"
    text = " and ".join(part for part in (low, high) if part)
    return f" of {text}" if text.startswith("at") else f" {text}" if text else ""


def _length(metadata: tuple[Any, ...], of: str) -> str:
    bounds = {
        name: getattr(each, name)
        for each in metadata
        for name in ("min_length", "max_length")
        if _has(each, name)
    }
    low, high = bounds.get("min_length"), bounds.get("max_length")
    if low and high:
        return f" of {low} to {high} {of}"
    return f" of at least {low} {of}" if low else f" of at most {high} {of}" if high else ""


def _has(constraint: Any, name: str) -> bool:
    return getattr(constraint, name, None) is not None


def _findings(model: type[BaseModel], raw: dict[str, Any], error: ValidationError) -> Iterator[Finding]:
    """One finding for each path, the deepest of a union's alternatives, in the order of the file."""
    by_path: dict[Path, Any] = {}
    for each in error.errors(include_url=False):
        by_path.setdefault(_path(each["loc"], raw, each["type"] == "missing"), each)
    for path, each in by_path.items():
        if any(other != path and other[: len(path)] == path for other in by_path):
            continue
        yield _finding(model, raw, path, each)


def _finding(model: type[BaseModel], raw: dict[str, Any], path: Path, error: Any) -> Finding:
    kind = error["type"]
    if kind == "extra_forbidden":
        owner = _annotation(model, path[:-1])
        known = list(owner[0].model_fields) if owner and hasattr(owner[0], "model_fields") else []
        return Finding(path, f"unknown key{suggestion(str(path[-1]), known)}", at_key=True)
    if kind in ("value_error", "assertion_error"):
        return Finding(path, str(error["ctx"]["error"]))
    field = _annotation(model, path)
    wanted = expected(*field) if field else ""
    if kind == "missing":
        return Finding(path, f"missing; expected {wanted}" if wanted else "missing", at_key=True)
    value = _value(raw, path)
    if not wanted or kind not in _SHAPES:
        return Finding(path, f"{error['msg'][0].lower()}{error['msg'][1:]}, found {found(value)}")
    hint = ""
    if isinstance(value, str) and kind == "literal_error":
        near = closest(value, [str(name) for name in _choices(field[0] if field else None)])
        hint = f"; did you mean '{near}'?" if near else ""
    elif kind == "string_type" and isinstance(value, (int, float)):
        hint = f"; put it in quotes: '{found(value)}'"
    return Finding(path, f"expected {wanted}, found {found(value)}{hint}")


# Errors of pydantic that are told best by what the field takes as a whole.
_SHAPES = {
    *(
        "int_type",
        "int_parsing",
        "int_parsing_size",
        "int_from_float",
        "float_type",
        "float_parsing",
        "finite_number",
    ),
    *("bool_type", "bool_parsing", "string_type", "string_too_short", "string_too_long", "literal_error"),
    *("greater_than", "greater_than_equal", "less_than", "less_than_equal", "list_type", "tuple_type"),
    *("too_short", "too_long", "dict_type", "model_type", "model_attributes_type", "none_required"),
}


def _extremes(value: Any, path: Path) -> Iterator[Finding]:
    """Finite numbers too large or too small to be computed with."""
    if isinstance(value, (dict, list)):
        for key, item in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _extremes(item, (*path, key))
    elif _is_number(value) and value != 0 and not SMALLEST <= abs(value) <= LARGEST:
        magnitudes = f"from {SMALLEST:g} to {LARGEST:g} in magnitude"
        yield Finding(path, f"expected 0 or a number {magnitudes}, found {found(value)}")


def _is_number(value: Any) -> bool:
    """Whether it is an integer, of any length, or a finite float."""
    return isinstance(value, int) or (isinstance(value, float) and math.isfinite(value))


def _path(loc: tuple[str | int, ...], raw: Any, missing: bool) -> Path:
    """The part of pydantic's location that exists in the data; names of a union's members are left out."""
    path: list[str | int] = []
    for position, part in enumerate(loc):
        inside = (isinstance(raw, dict) and part in raw) or (isinstance(raw, list) and isinstance(part, int))
        if inside:
            path.append(part)
            raw = raw[part]
        elif missing and position == len(loc) - 1:
            path.append(part)
    return tuple(path)


def _value(raw: Any, path: Path) -> Any:
    for part in path:
        raw = raw[part]
    return raw


def _choices(annotation: Any) -> Iterator[Any]:
    if get_origin(annotation) is Literal:
        yield from get_args(annotation)
    else:
        for member in get_args(annotation):
            yield from _choices(member)


def _annotation(
    annotation: Any, path: Path, metadata: tuple[Any, ...] = ()
) -> tuple[Any, tuple[Any, ...]] | None:
    """The annotation at a path below a model, a list or a union of them, with its constraints."""
    if get_origin(annotation) is Annotated:
        inner, *constraints = get_args(annotation)
        return _annotation(inner, path, (*constraints, *metadata))
    if not path:
        return annotation, metadata
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        info = annotation.model_fields.get(str(path[0]))
        return _annotation(info.annotation, path[1:], tuple(info.metadata)) if info else None
    origin, members = get_origin(annotation), get_args(annotation)
    if origin in (Union, types.UnionType):
        return next((field for member in members if (field := _annotation(member, path))), None)
    if origin in (list, tuple, dict):
        return _annotation(members[1 if origin is dict else 0], path[1:])
    return None
