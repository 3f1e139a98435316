"""Claim: two mistakes in one file are both said, unless one is a mistake only by what the other should be."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from nlbench import config
from nlbench.errors import ConfigError
from tests.example import VALID, written

SOUND: dict[str, Any] = {
    "experiment": "culver/hermite-01",
    "system": {"name": "culver-scalar", "ensemble": "matched", "measurement": "linear", "interval": 0.1},
    "filters": [
        {"name": "linearised-kalman"},
        {"name": "third-order", "limiter": 3, "label": "third 3 sigma"},
        {"name": "third-order-guarded", "initial": {"mean": [0.0], "cov": [[1.0]]}},
    ],
    "truth": {"measurement_variance": 1.6},
    "reference": "exact",
    "time": {"end": 2.0, "step": 0.02, "output": 0.1},
    "report_times": [0.5, 1.0, 2.0],
    "monte_carlo": {"runs": 20_000, "seed": 1969},
    "traces": [7, 8],
    "source": {"document": "culver-1969", "figures": ["7.18", "7.19"]},
    "claims": [
        {"id": "C1", "says": "x", "statistic": "rms", "less": ["third 3 sigma", "exact"], "at": [1.0]},
        {"id": "C2", "says": "y", "statistic": "rms", "of": ["exact"], "below": 1.0, "figures": ["7.18"]},
    ],
}
MISTAKES: dict[str, Any] = {
    "experiment": "../up",
    "system.name": "culver-scaler",
    "system.ensemble": "matchd",
    "system.measurement": "lineer",
    "system.intervall": 0.1,
    "filters.0.name": "linearised-kalmann",
    "filters.1.limiter": -3,
    "filters.1.limter": 3,
    "filters.1.step": -1,
    "filters.1.label": "linearised-kalman",
    "filters.2.initial.cov": [[-1.0]],
    "filters.2.model": 3,
    "truth.measurement_variance": -1,
    "reference": "best",
    "time.step": -1,
    "time.end": 1.95,
    "time.output": 0.03,
    "time.outptu": 0.1,
    "report_times.0": 0.55,
    "report_times.1": 0.5,
    "report_times.2": -2.0,
    "monte_carlo.runs": 0,
    "monte_carlo.seeed": 1,
    "traces.0": -1,
    "traces.1": 30_000,
    "source.figures": "7.18",
    "source.document": 3,
    "claims.0.at.0": 1.2,
    "claims.0.says": "",
    "claims.0.less.0": "third-order",
    "claims.0.factr": 2,
    "claims.1.id": "C1",
    "claims.1.says": 3,
    "claims.1.above": 2.0,
    "claims.1.below": "x",
    "claims.1.figures.0": "7.20",
    "engine.precision": "float16",
    "limits.diverged": 2,
    "initial": {"cov": [[1.0, 0.5], [0.0, 1.0]], "maen": 1},
    "figure": ["rms"],
}
# What else becomes wrong: a time after the end, a label and a report time that are no longer there.
CAUSES = {
    "time.end": {"report_times.2"},
    "filters.1.label": {"claims.0.less.0"},
    "report_times.1": {"claims.0.at.0"},
}
# Whether the first is a mistake depends on what should stand in the place of the second.
DEPENDS = {
    ("system.ensemble", "system.name"),
    ("system.measurement", "system.name"),
    ("system.intervall", "system.name"),
    ("truth.measurement_variance", "system.name"),
    ("filters.1.label", "filters.0.name"),
    ("claims.0.less.0", "reference"),
    ("claims.0.at.0", "report_times.2"),
    ("claims.1.figures.0", "source.figures"),
    ("claims.1.above", "claims.1.below"),
    ("traces.1", "monte_carlo.runs"),
    ("report_times.1", "report_times.0"),
    ("time.output", "time.step"),
}


def spoil(data, key, value):
    """Put the value at the key; a list of names is replaced where an entry of it is meant."""
    *path, last = key.split(".")
    holder = data
    for part in path:
        holder = holder[int(part)] if isinstance(holder, list) else holder.setdefault(part, {})
    holder[int(last) if isinstance(holder, list) else last] = value


def findings(*keys):
    """Paths and messages of all that is said of these mistakes."""
    data = copy.deepcopy(SOUND)
    for key in keys:
        spoil(data, key, MISTAKES[key])
    with pytest.raises(ConfigError) as caught:
        config.from_dict(data)
    return {(each.path, each.message) for each in caught.value.problems}


ALONE = {key: findings(key) for key in MISTAKES}


def places(found):
    return {path for path, _ in found}


def is_of(key, path):
    """Whether a finding at the path is about the key, or about what holds it."""
    return path.startswith(key) or key.startswith(path)


@pytest.mark.parametrize("key", MISTAKES)
def test_each_mistake_is_said_once_at_its_place_and_makes_no_other(key):
    others = {path for path in places(ALONE[key]) if not is_of(key, path)}
    assert others == CAUSES.get(key, set())
    assert len(ALONE[key]) == len(others) + (2 if key == "initial" else 1)


@pytest.mark.parametrize("first", MISTAKES)
def test_no_mistake_hides_another(first):
    for second in MISTAKES:
        if not is_of(first, second) and (second, first) not in DEPENDS:
            of_second = {path for path in places(ALONE[second]) if is_of(second, path)}
            hidden = of_second - places(findings(first, second))
            assert not hidden, f"{first} hides {hidden}"


def test_an_option_that_is_none_hides_neither_another_nor_the_file(tmp_path):
    text = VALID.replace("step: 0.02", "step: -1")
    with pytest.raises(ConfigError) as caught:
        config.load(written(tmp_path, text), ["nonsense", "filters.9.limiter=1", "monte_carlo.run=5", "x=]"])
    found = {(each.file.split("/")[-1], each.path) for each in caught.value.problems}
    assert {
        ("--set nonsense", ""),
        ("--set filters.9.limiter", "filters.9.limiter"),
        ("--set monte_carlo.run", "monte_carlo.run"),
        ("--set x", "x"),
        ("fig.yaml", "time.step"),
    } <= found


@pytest.mark.parametrize(
    ("system", "model"),
    [
        ("schwarz", {}),
        ({"name": "culver-scalar", "measurement": "contnuous"}, {}),
        ("culver-scalar", {"measurement": "contnuous"}),
    ],
)
def test_no_filter_is_refused_for_a_kind_that_is_not_known(system, model):
    """`kushner-2` is for continuous measurements; its option is wrong whatever the system is."""
    filters = [{"name": "kushner-2", "limter": 3, "model": model}, "ekf"]
    data = {"experiment": "x", "system": system, "filters": filters}
    with pytest.raises(ConfigError) as caught:
        config.from_dict(data)
    assert len({each.path for each in caught.value.problems} - {"filters.0.limter"}) == 1
    assert len(caught.value.problems) == 2
