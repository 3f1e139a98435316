"""Claim: the published JSON Schema is that of the models, and takes what `validate` takes."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner

from nlbench import config, systems
from nlbench.cli.app import app
from nlbench.config.assemble import MANDATORY
from nlbench.config.document import value_of
from nlbench.config.editor import json_schema
from nlbench.config.schema import Experiment
from nlbench.errors import ConfigError
from nlbench.filters import catalogue

ROOT = Path(__file__).parents[2]
CONFIGS = sorted((ROOT / "configs").rglob("*.yaml"))
PUBLISHED = ROOT / "docs" / "schema" / "experiment.json"
TANK = """
import numpy as np
import nlbench as nb

def tank(leak: float = 0.1) -> nb.System:
    return nb.System(
        drift=lambda t, x: -leak * x, observe=lambda t, x: x, measurement_cov=np.eye(1),
        initial=nb.Moments(mean=np.ones(1), cov=np.eye(1)), interval=1.0,
    )

SYSTEMS = {"tank": tank}
"""


def printed(*arguments: str) -> str:
    return CliRunner().invoke(app, ["schema", *arguments]).stdout


def test_the_published_file_is_what_is_printed():
    assert PUBLISHED.read_text() == printed(), f"renew it: nlbench schema > {PUBLISHED}"


def test_with_a_plug_in_it_takes_its_names_and_parameters(tmp_path):
    file = tmp_path / "tank.py"
    file.write_text(TANK)
    data = {"experiment": "small", "system": {"name": "tank", "leak": 0.2}, "filters": ["ekf"]}
    with_plugin, without = (checker(json.loads(printed(*words))) for words in (["--plugin", str(file)], []))
    assert with_plugin.is_valid(data)
    assert not with_plugin.is_valid(data | {"system": {"name": "tank", "leek": 0.2}})
    assert not without.is_valid(data)


def test_it_knows_every_key_system_and_filter():
    schema = json_schema()
    assert set(schema["properties"]) == set(Experiment.model_fields) - {"question"}
    names = lambda part: set(part["anyOf"][0]["enum"])  # noqa: E731
    assert names(schema["properties"]["system"]) == set(systems.available())
    assert names(schema["properties"]["filters"]["items"]) == set(catalogue.available())


@pytest.fixture(scope="module")
def validator():
    return checker(json_schema())


def checker(schema):
    validators = pytest.importorskip("jsonschema").validators
    kind = validators.validator_for(schema)
    kind.check_schema(schema)
    return kind(schema)


def read(path: Path):
    """As an editor reads it: YAML 1.2, in which 20_000 is text."""
    return plain(YAML(typ="safe", pure=True).load(path.read_text()))


def plain(value):
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list) else value


def test_it_takes_all_experiments(validator):
    assert len(CONFIGS) > 90
    wrong = {path.name: error.message for path in CONFIGS for error in validator.iter_errors(read(path))}
    assert wrong == {}


@pytest.mark.parametrize("text", ["20_000", "2_0e3", "0x1_F", "0b1_0", "1_000.0"])
def test_digits_may_be_grouped(validator, text):
    given = read(CONFIGS[-1])
    config.load(CONFIGS[-1], [f"monte_carlo.runs={text}"])
    assert validator.is_valid(given | {"monte_carlo": {"runs": text}})
    assert not validator.is_valid(given | {"monte_carlo": {"runs": f"{text} many"}})


@pytest.mark.parametrize("text", ["1_000.5", "-1_0.5e-3", ".5_0"])
def test_so_may_those_of_fractions(validator, text):
    data = {"experiment": "small", "system": "oscillator", "filters": ["ekf"]}
    config.from_dict(data | {"initial": {"mean": [value_of(text, "--set"), 0.0, 0.0]}})
    assert validator.is_valid(data | {"initial": {"mean": [text, 0.0, 0.0]}})


@pytest.mark.parametrize("key", sorted(set(Experiment.model_fields) - {"question"}))
def test_both_take_no_value_for_what_may_be_left_out(validator, key):
    data = {"experiment": "small", "system": "oscillator", "filters": ["ekf"], key: None}
    if key in MANDATORY:
        assert not validator.is_valid(data)
        with pytest.raises(ConfigError):
            config.from_dict(data)
    else:
        assert validator.is_valid(data)
        config.from_dict(data)


def wrongs():
    """Changes that both must refuse."""
    return {
        "a key misspelt": lambda data: data.update(monte_carl={"runs": 3}),
        "a key of a section misspelt": lambda data: data.update(monte_carlo={"run": 3}),
        "an unknown filter": lambda data: data.update(filters=["efk"]),
        "an option of another filter": lambda data: data.update(filters=[{"name": "ekf", "particles": 3}]),
        "an unknown system": lambda data: data.update(system="pendulum"),
        "a parameter of another system": lambda data: data.update(system={"name": "oscillator", "decay": 1}),
        "a negative step": lambda data: data.update(time={"step": -1}),
        "text for a number": lambda data: data.update(monte_carlo={"seed": "yes"}),
        "a wrong statistic": lambda data: data.update(claims=[{"id": "A", "says": "b", "statistic": "rsm"}]),
        "no system": lambda data: data.pop("system"),
    }


@pytest.mark.parametrize("change", wrongs())
def test_it_refuses_what_validate_refuses(validator, change):
    data = {"experiment": "small", "system": "oscillator", "filters": ["ekf"]}
    assert validator.is_valid(data)
    config.from_dict(copy.deepcopy(data))
    wrongs()[change](data)
    assert not validator.is_valid(data)
    with pytest.raises(ConfigError):
        config.from_dict(data)
