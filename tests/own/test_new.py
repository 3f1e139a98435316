"""Claim: what `nlbench new` writes works as it stands, says what to do next, and never overwrites."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench import config, plugins
from nlbench.cli.app import app
from nlbench.cli.new import COMPARED

PYPROJECT = Path(__file__).parents[2] / "pyproject.toml"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yield
    plugins.forget()


def command(line: str):
    program, *arguments = shlex.split(line)
    assert program == "nlbench"
    return CliRunner().invoke(app, arguments)


def following(line: str) -> str:
    """The next step that a command prints, which succeeded."""
    done = command(line)
    assert done.exit_code == 0, done.output
    return re.search(r"next: (.*)", done.stdout).group(1)


def test_the_steps_that_are_printed_lead_to_an_experiment_that_is_valid():
    for line in (
        "nlbench new system my_swing",
        "nlbench new filter my-fading",
        "nlbench new experiment third",
    ):
        step = following(line)
        if "experiment" in step:
            step = following(step)
        assert step.startswith("nlbench run ")
        done = command(step.replace(" run ", " validate "))
        assert done.exit_code == 0, done.output
    assert {path.name for path in Path().iterdir()} == {
        "my_swing.py",
        "my_fading.py",
        "third.yaml",
        "try_my_swing.yaml",
        "try_my_fading.yaml",
    }


@pytest.mark.long
@pytest.mark.parametrize("what", ["system", "filter", "experiment"])
def test_each_skeleton_runs_as_it_stands(what):
    step = following(f"nlbench new {what} mine")
    if what != "experiment":
        step = following(step)
    done = command(step)
    assert done.exit_code == 0, done.output
    assert "C1  confirmed" in done.stdout if what == "experiment" else "C1  " in done.stdout
    assert "FAILED" not in done.output


def test_the_skeletons_compute_what_they_say(tmp_path):
    """The pendulum's drift by hand; fading by 1 is the extended Kalman filter, and by more an update with a P."""
    command("nlbench new system swing")
    command("nlbench new filter fading")
    nb.allow("swing.py", "fading.py")
    swing = nb.systems.build("swing", stiffness=3.0, friction=0.5)
    angle, rate = 0.7, -0.2
    assert np.allclose(swing.drift(0.0, np.array([angle, rate])), [rate, -3.0 * np.sin(angle) - 0.5 * rate])
    assert np.allclose(swing.observe(0.0, np.array([angle, rate])), [np.sin(angle)])
    y = np.array([0.9])
    m, P = np.asarray(swing.initial.mean), np.asarray(swing.initial.cov)
    H, R = np.array([[np.cos(m[0]), 0.0]]), 0.05
    for a in (1.0, 1.3):
        f = nb.filters.build("fading", swing, fading=a)
        posterior = f.moments(f.update(f.init(swing.initial), 0.2, y)[0])
        K = a * P @ H.T / (a * H @ P @ H.T + R)
        assert np.allclose(posterior.mean, m + K[:, 0] * (y - np.sin(m[0])), rtol=0, atol=1e-10)
        assert np.allclose(posterior.cov, a * P - K @ H @ (a * P), rtol=0, atol=1e-10)


def test_the_skeletons_are_in_the_style_of_the_package():
    for what in ("system", "filter"):
        command(f"nlbench new {what} a_name_of_{what}")
    for check in (["check", "--ignore", "I001"], ["format", "--check"]):
        line = [sys.executable, "-m", "ruff", *check, "--config", str(PYPROJECT), "."]
        done = subprocess.run(line, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("what", ["system", "filter", "experiment"])
def test_nothing_is_overwritten(what):
    assert command(f"nlbench new {what} mine").exit_code == 0
    (path,) = Path().iterdir()
    path.write_text("mine")
    done = command(f"nlbench new {what} mine")
    assert done.exit_code == 2
    assert done.stderr == f"{path}: exists, and is not overwritten; choose another name or folder\n"
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("system ../there", "'../there': expected a name"),
        ("system class", "'class': expected a name"),
        ("system Upper", "'Upper': expected a name"),
        ("system oscillator", "'oscillator' is the name of a built-in system"),
        ("filter ekf", "'ekf' is the name of a built-in filter"),
        ("filter gaussian", "'gaussian' is a name that the code of the skeleton uses"),
        ("filter len", "'len' is a name that the code of the skeleton uses"),
        ("system nb", "'nb' is a name that the code of the skeleton uses"),
        ("system jnp", "'jnp' is a name that the code of the skeleton uses"),
        ("experiment null", "'null': means something else in YAML"),
        (
            "experiment x --system schwartz --filter ukf",
            "--filter: 'ukf' takes measurements at discrete times",
        ),
        ("experiment x --system osillator", "unknown system 'osillator'; did you mean 'oscillator'?"),
        ("experiment x --filter efk", "unknown filter 'efk'; did you mean 'ekf'?"),
        ("sistem x", "sistem"),
    ],
)
def test_a_mistake_ends_with_two_and_writes_nothing(line, message):
    done = command(f"nlbench new {line}")
    assert done.exit_code == 2
    assert message in done.stderr
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("system", nb.systems.available())
def test_an_experiment_is_valid_for_every_system_and_compares_different_filters(system):
    simple, better = COMPARED[nb.systems.kind(system, nb.systems.parameters(system)().model_dump())]
    chosen = [[], [simple], [better], ["ekf"], ["no-filter"], [simple, "ekf", "no-filter"]]
    for number, filters in enumerate(chosen):
        options = "".join(f" --filter {each}" for each in filters)
        done = command(f"nlbench new experiment try-{number} --system {system}{options}")
        assert done.exit_code == 0, done.output
        stated = config.load(f"try_{number}.yaml")
        assert stated.system.name == system
        assert stated.question.endswith(f"on {system}?")
        assert [claim.id for claim in stated.claims] == ["C1", "C2"]
        assert set(filters) <= set(stated.labels)
        less = stated.claims[0].less
        assert less[0] == (filters or [better])[0].replace("no-filter", better)
        assert set(less) != {"ekf", "linearised-kalman"}  # two names of one filter


def test_an_experiment_says_which_parameters_it_still_needs():
    Path("own.py").write_text(
        "def decay(rate: float, start: float = 1.0): pass\ndef mine(system, gain: float): pass\n"
        "SYSTEMS = {'decay': decay}\nFILTERS = {'mine': mine}\n"
    )
    line = "nlbench new experiment x --system decay --filter mine --plugin own.py"
    assert following(line) == "nlbench validate x.yaml --plugin own.py"
    text = Path("x.yaml").read_text()
    assert "system: {name: decay}  # not valid yet: decay needs rate (a number)\n" in text
    assert "filters: [ekf, mine]  # not valid yet: mine needs gain (a number)\n" in text
    done = command("nlbench validate x.yaml --plugin own.py")
    assert done.exit_code == 2
    assert "system.rate: missing; expected a number" in done.stderr
    assert "filters.1.gain: missing; expected a number" in done.stderr
