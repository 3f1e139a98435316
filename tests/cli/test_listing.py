"""Claim: everything that an experiment file may name can be listed, for people and for programs."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from nlbench import doctor, systems
from nlbench.cli.app import app
from nlbench.filters import catalogue
from tests.example import VALID, spoiled, written


def invoke(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.parametrize(("what", "registry"), [("systems", systems), ("filters", catalogue)])
def test_every_registered_name_is_listed_with_its_meaning(what, registry):
    listed = json.loads(invoke("list", what, "--json").stdout)
    assert [each["name"] for each in listed] == list(registry.available())
    assert [each["summary"] for each in listed] == [registry.summary(name) for name in registry.available()]
    text = invoke("list", what).stdout
    assert all(name in text for name in registry.available())
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(
    ("what", "name", "model"),
    [("systems", name, systems.parameters(name)) for name in systems.available()]
    + [("filters", name, catalogue.options(name)) for name in catalogue.available()],
)
def test_the_parameters_of_every_name_can_be_shown(what, name, model):
    shown = json.loads(invoke("list", what, name, "--json").stdout)
    assert [each["name"] for each in shown["parameters"]] == list(model.model_fields)
    assert invoke("list", what, name).exit_code == 0


def test_parameters_without_a_default_are_said_to_be_required(tmp_path):
    plugin = tmp_path / "own.py"
    plugin.write_text(
        "def decay(rate: float, start: float = 1.0): pass\ndef mine(system, gain: float): pass\n"
        "SYSTEMS = {'decay': decay}\nFILTERS = {'mine': mine}\n"
    )
    assert "decay" in invoke("list", "systems", "--plugin", str(plugin)).stdout
    text = invoke("list", "systems", "decay", "--plugin", str(plugin)).stdout
    assert "rate   a number; required\n" in text
    assert "start  a number; default 1\n" in text
    assert (
        "gain     a number; required\n" in invoke("list", "filters", "mine", "--plugin", str(plugin)).stdout
    )
    shown = json.loads(invoke("list", "systems", "decay", "--json", "--plugin", str(plugin)).stdout)
    assert [(each["name"], each["default"], each["required"]) for each in shown["parameters"]] == [
        ("rate", None, True),
        ("start", 1, False),
    ]


def test_experiments_are_listed_by_their_question_and_invalid_ones_are_said_to_be(tmp_path):
    (tmp_path / "culver").mkdir()
    written(tmp_path / "culver", VALID, "good.yaml")
    written(tmp_path, spoiled("limiter", "limter"), "bad.yaml")
    listed = json.loads(invoke("list", "experiments", "--configs", str(tmp_path), "--json").stdout)
    assert [each["valid"] for each in listed] == [False, True]
    assert listed[1]["question"] == "Does carrying the third moment pay when measurements arrive?"
    assert "not valid (1 problem)" in invoke("list", "experiments", "--configs", str(tmp_path)).stdout


def test_validate_tells_programs_what_it_tells_people(tmp_path):
    good = json.loads(invoke("validate", str(written(tmp_path, VALID)), "--json").stdout)
    assert good["valid"]
    assert good["resolved"]["monte_carlo"]["runs"] == 20_000
    bad = invoke("validate", str(written(tmp_path, spoiled("limiter", "limter"))), "--json")
    assert bad.exit_code == 2
    (problem,) = json.loads(bad.stdout)["problems"]
    assert (problem["line"], problem["path"]) == (6, "filters.1.limter")


def test_doctor_ends_with_five_when_something_is_wrong(monkeypatch):
    monkeypatch.setattr(doctor, "doctor", lambda: [("python", True, "3.12"), ("jax", False, "missing")])
    done = invoke("doctor")
    assert done.exit_code == 5
    assert done.stderr == "not in order: jax\n"
    monkeypatch.setattr(doctor, "doctor", lambda: [("python", True, "3.12")])
    assert invoke("doctor").exit_code == 0


def test_the_list_says_which_systems_a_filter_is_for_and_of_which_kind_a_system_is():
    def kinds(what):
        return {each["name"]: each["kinds"] for each in json.loads(invoke("list", what, "--json").stdout)}

    assert kinds("systems")["ungm"] == ["discrete time"]
    assert kinds("systems")["schwartz"] == ["continuous measurements"]
    assert kinds("filters")["third-order"] == ["continuous time"]
    assert kinds("filters")["ukf"] == ["continuous time", "discrete time"]
    assert "\nfor continuous time, discrete time\n" in "\n" + invoke("list", "filters").stdout
    shown = json.loads(invoke("list", "filters", "ekf", "--json").stdout)
    others = shown["parameters_of_other_kinds"]
    assert "equations" not in {each["name"] for each in others["discrete time"]}
    assert "\ndiscrete time\n" in invoke("list", "filters", "ekf").stdout
