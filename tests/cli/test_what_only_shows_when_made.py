"""What shows only when systems and filters are made is found by `validate` already, with its place, all at once."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nlbench.cli.app import app

FILE = """# Is all of it found?
experiment: made
system: oscillator
filters:
  - ekf
  - {name: third-order, initial: {mean: [1, 2]}}
  - {name: ukf, kappa: -30, initial: {variance: [1]}}
  - {name: direct-2, points: 101}
  - {name: statistical-linearisation, points: 50}
  - {name: gaussian-sum, components: 50}
claims:
  - {id: A, says: so, statistic: rms, less: [ekf, third-order], coordinate: positon}
"""
COORDINATE = "'A' is about the coordinate 'positon', which the system does not have; did you mean 'position'?"
PROBLEMS = {
    (6, 41): "filters.1.initial.mean: got shape (2,), the system needs (3,)",
    (7, 29): "filters.2.initial.cov: got shape (1, 1), the system needs (3, 3)",
    (7, 5): "filters.2: ukf.kappa: -30.0 must be above -3",
    (8, 5): "filters.3: direct-2.points: 101 along each of 3 states are more than 1,000,000 nodes",
    (9, 5): "filters.4: points: 50^3 = 125000 points; a product rule takes at most 100000",
    (12, 77): f"claims.0.coordinate: {COORDINATE}",
}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "made.yaml"
    path.write_text(FILE)
    return path


def said(*arguments):
    done = CliRunner().invoke(app, [*map(str, arguments)])
    assert done.exit_code == 2, done.output
    return done.stderr


@pytest.mark.parametrize("command", ["validate", "plan", "run"])
def test_every_problem_is_told_at_its_place_before_anything_is_written(file, command):
    text = said(command, file)
    place = (f"{file}:{line}:{column}: {message}" for (line, column), message in PROBLEMS.items())
    missing = [each for each in place if each not in text]
    assert not missing, text
    assert [each.name for each in file.parent.iterdir()] == ["made.yaml"]


def test_an_option_that_brings_a_wrong_size_is_named(file):
    text = said("validate", file, "--set", "initial.mean=[3]")
    assert "--set initial.mean: got shape (1,), the system needs (3,)" in text


@pytest.mark.parametrize(
    ("name", "tolerance", "message"),
    [
        ("Tsit6", None, "found 'Tsit6'; did you mean 'Tsit5'?"),
        ("Kvaerno5", None, "Kvaerno5 solves equations in each step: give rtol or atol"),
        ("Euler", 1e-6, "Euler makes fixed steps: leave rtol and atol out"),
        ("rk4", 1e-6, "rk4 makes fixed steps: leave rtol and atol out"),
    ],
)
def test_a_solver_that_cannot_integrate_is_refused(tmp_path, name, tolerance, message):
    chosen = f"{{solver: {name}}}" if tolerance is None else f"{{solver: {name}, rtol: {tolerance}}}"
    path = tmp_path / "solver.yaml"
    path.write_text(
        f"experiment: solver\nsystem: culver-scalar\nfilters:\n  - {{name: ekf, integrator: {chosen}}}\n"
    )
    text = said("validate", path)
    assert f"{path}:4:" in text
    assert message in text
