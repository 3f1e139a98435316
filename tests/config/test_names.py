"""Claim: names may hold capitals, and where two names meet that differ in capitals only, the second is refused."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nlbench import config, plugins
from nlbench.cli.app import app
from nlbench.errors import ConfigError

CLAIM = {"says": "x", "statistic": "rms", "of": ["EKF"], "below": 1}
PLUGIN = "import nlbench as nb\n\ndef tank(leak: float = 0.1) -> nb.System:\n    raise SystemExit\n\n"


def experiment(name="MyRun", **changes):
    plain = {"experiment": name, "system": "culver-scalar", "filters": [{"name": "ekf", "label": "EKF"}]}
    return config.from_dict({**plain, **changes})


def problems(**changes):
    with pytest.raises(ConfigError) as caught:
        experiment(**changes)
    return {each.path: each.message for each in caught.value.problems}


@pytest.mark.parametrize("name", ["MyRun", "Culver/Hermite-01", "A", "x.Y_z"])
def test_the_name_of_an_experiment_may_hold_capitals(tmp_path, name):
    found = experiment(name)
    assert found.experiment == name
    assert found.folder(tmp_path).parent == tmp_path / name


def test_labels_that_differ_in_capitals_only_are_refused():
    assert problems(filters=["ekf", {"name": "ukf", "label": "EKF"}]) == {
        "filters.1.label": "'EKF' differs in capitals only from 'ekf', the label of filters.0; "
        "give this one a label of its own"
    }
    (message,) = problems(filters=["ekf", {"name": "ukf", "label": "Exact"}], reference="exact").values()
    assert message.startswith("'Exact' differs in capitals only from 'exact', the label of the reference")


def test_claims_whose_ids_differ_in_capitals_only_are_refused():
    (message,) = problems(claims=[{"id": "c1", **CLAIM}, {"id": "C1", **CLAIM}]).values()
    assert message == "'C1' differs in capitals only from 'c1', the id of claims.0"


@pytest.mark.parametrize(("there", "name"), [("myrun", "MyRun"), ("Culver/x", "culver/x"), ("a/B", "a/b")])
def test_results_lie_beside_none_whose_name_differs_in_capitals_only(tmp_path, there, name):
    (tmp_path / there / "0123456789ab").mkdir(parents=True)
    with pytest.raises(
        ConfigError, match=rf"^experiment: '{name}' differs in capitals only from .*{tmp_path}"
    ):
        experiment(name).folder(tmp_path)
    assert experiment(there).folder(tmp_path).parent == tmp_path / there


@pytest.mark.parametrize(
    ("names", "says"),
    [("'EKF': tank", ""), ("'tank': tank, 'Tank': tank", "'Tank' differs in capitals only from 'tank'")],
)
def test_a_plug_in_names_as_experiments_do(tmp_path, names, says):
    path = tmp_path / "tank.py"
    path.write_text(f"{PLUGIN}SYSTEMS = {{{names}}}\n")
    plugins.forget()
    try:
        if says:
            with pytest.raises(ConfigError, match=says):
                config.allow(path)
        else:
            config.allow(path)
            assert "EKF" in plugins.names("systems")
    finally:
        plugins.forget()


def test_a_name_that_is_a_built_in_one_but_for_capitals_is_refused(tmp_path):
    path = tmp_path / "tank.py"
    path.write_text(f"{PLUGIN}SYSTEMS = {{'Oscillator': tank}}\n")
    with pytest.raises(ConfigError, match="'Oscillator' differs in capitals only from 'oscillator'"):
        config.allow(path)


def test_what_is_begun_may_hold_capitals_and_stands_beside_no_file_that_differs_in_them(
    tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["new", "experiment", "MyRun"])
    assert done.exit_code == 0, done.output
    assert config.load("MyRun.yaml").experiment == "MyRun"
    again = CliRunner().invoke(app, ["new", "experiment", "myrun"])
    assert again.exit_code == 2
    assert "MyRun.yaml: exists, and is not overwritten" in again.stderr
