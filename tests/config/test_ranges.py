"""Claim: no key, parameter or option takes a number that nothing can be computed with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, get_args

import pytest
from pydantic import BaseModel

from nlbench import systems
from nlbench.config.assemble import SECTIONS, Named
from nlbench.config.claim import Claim
from nlbench.config.explain import LARGEST, SMALLEST, validated
from nlbench.config.schema import Head, Initial, TimeSpec
from nlbench.filters import catalogue

KEYS = {model.__name__: model for model in (*SECTIONS.values(), Claim, Head, Initial, Named, TimeSpec)}
MODELS = {
    **KEYS,
    **{f"system {name}": systems.parameters(name) for name in systems.MODULES},
    **{
        f"filter {name} {kind}": catalogue.options(name, *kind)
        for name in catalogue.available()
        for kind in catalogue.takes(name)
    },
}
UNBOUNDED = {("Head", "traces")}  # compared with the number of runs, which is bounded
OF = {float: math.inf, int: 10**30}


def numbers(annotation: Any, kind: type) -> Iterator[Any]:
    """Values in which the number stands wherever the annotation takes one of its kind."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        for name, field in annotation.model_fields.items():
            for value in numbers(field.annotation, kind):
                yield {name: value}
    elif annotation is kind:
        yield OF[kind]
    elif getattr(annotation, "__origin__", None) is list:
        yield from ([value] for value in numbers(get_args(annotation)[0], kind))
    else:
        for member in get_args(annotation):
            yield from numbers(member, kind)


def given(kind: type) -> Iterator[tuple[str, type[BaseModel], str, Any]]:
    for name, model in MODELS.items():
        for field, info in model.model_fields.items():
            for value in numbers(info.annotation, kind):
                yield name, model, field, value


def taken(kind: type) -> set[tuple[str, str]]:
    """What takes the number: nothing is wrong with it or with what stands in it."""
    return {
        (name, field)
        for name, model, field, value in given(kind)
        if not any(each.path[:1] == (field,) for each in validated(model, {field: value})[1])
    }


def test_every_float_must_be_finite():
    assert len(list(given(float))) > 100
    assert taken(float) == set()


def test_every_count_has_a_largest_value():
    assert len(list(given(int))) > 30
    assert taken(int) == UNBOUNDED


@pytest.mark.parametrize("value", [SMALLEST, LARGEST])
@pytest.mark.parametrize("name", systems.available())
def test_a_system_can_be_built_of_the_smallest_and_the_largest_numbers(name, value):
    model = systems.parameters(name)
    for field in model.model_fields:
        if validated(model, {field: value})[0]:
            systems.build(name, **{field: value})


@pytest.mark.parametrize("value", [0.99 * SMALLEST, 1.01 * LARGEST, -1.01 * LARGEST, int(LARGEST) * 2])
def test_beyond_them_a_number_is_refused_with_its_path(value):
    _, findings = validated(Initial, {"mean": [1.0, value]})
    assert [each.path for each in findings] == [("mean", 1)]
    assert findings[0].message.startswith("expected 0 or a number from 1e-100 to 1e+100 in magnitude, found ")
