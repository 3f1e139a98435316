"""Claim: of a system in discrete time a file counts steps, and filters take the options of their rows for it."""

from __future__ import annotations

import pytest

from nlbench import config, systems
from nlbench.errors import ConfigError
from nlbench.filters import catalogue
from nlbench.systems.system import kind


def experiment(**changes):
    plain = {"experiment": "steps", "system": {"name": "ungm"}, "filters": ["ekf"]}
    return config.from_dict({**plain, **changes})


def problems(**changes):
    with pytest.raises(ConfigError) as caught:
        experiment(**changes)
    return {each.path: each.message for each in caught.value.problems}


@pytest.mark.parametrize("name", systems.available())
def test_the_kind_that_a_module_says_is_that_of_the_system_it_builds(name):
    parameters = systems.parameters(name)()
    assert systems.kind(name, parameters.model_dump(mode="json")) == kind(systems.build(name))


def test_the_kind_follows_a_parameter_that_decides_it():
    parameters = {"measurement": "continuous"}
    assert systems.kind("culver-scalar", parameters) == kind(systems.build("culver-scalar", **parameters))


def test_left_out_times_are_twenty_intervals_of_steps_of_one():
    time = experiment(system={"name": "ungm", "interval": 3}).time
    assert (time.end, time.output, time.step) == (60, 3, 1)
    own = {"name": "own", "time": "discrete"}
    assert experiment(system=own).time == config.schema.TimeSpec(end=20, output=1, step=1)
    assert experiment(time={"end": 500, "output": 10}).time.step == 1
    assert experiment(time={"end": 500, "step": 1}).time.output == 1


def test_times_that_are_not_whole_steps_are_refused_all_at_once():
    found = problems(
        system={"name": "own", "time": "discrete", "interval": 2.5},
        time={"end": 10.5, "output": 1.5, "step": 0.5},
    )
    assert set(found) == {"time.step", "time.output", "time.end", "system.interval"}
    assert "a step is 1, found 0.5" in found["time.step"]


def test_options_are_those_of_the_filter_for_the_systems_kind():
    (spec,) = experiment(filters=[{"name": "ekf", "limiter": 3.0}]).filters
    assert set(spec.options) == set(catalogue.options("ekf", discrete=True).model_fields)
    continuous = {"name": "culver-scalar", "measurement": "continuous"}
    (spec,) = experiment(system=continuous).filters
    assert set(spec.options) == set(catalogue.options("ekf", continuous=True).model_fields)
    (spec,) = experiment(system="culver-scalar").filters
    assert set(spec.options) == set(catalogue.options("ekf").model_fields)
    assert (
        "known: step, missing, limiter"
        in problems(filters=[{"name": "ekf", "equations": "printed"}])["filters.0.equations"]
    )


def test_filters_for_another_kind_are_refused_by_name_with_the_other_mistakes():
    found = problems(
        filters=["third-order", "kushner-2", {"name": "ukf", "alfa": 1}, {"name": "ckf", "step": 1}]
    )
    assert set(found) == {"filters.0.name", "filters.1.name", "filters.2.alfa", "filters.3.step"}
    assert (
        found["filters.0.name"]
        == "'third-order' integrates a drift in time, and the system's time is discrete"
    )
    found = problems(system="culver-scalar", filters=["kushner-2"])
    assert "continuous measurements" in found["filters.0.name"]
    found = problems(system="schwartz", filters=["ukf", "third-order"])
    assert set(found) == {"filters.0.name", "filters.1.name"}


@pytest.mark.parametrize("name", catalogue.available())
def test_a_filter_is_refused_just_where_its_family_takes_no_such_system(name):
    for which in catalogue.KINDS:
        assert (catalogue.refusal(name, *which) is None) == (which in catalogue.takes(name))
    assert catalogue.takes(name)


def test_what_is_resolved_is_read_back_the_same():
    first = experiment(filters=["ekf", {"name": "ukf", "alpha": 0.5}], time={"end": 50, "output": 5})
    assert config.from_dict(first.resolved()) == first
