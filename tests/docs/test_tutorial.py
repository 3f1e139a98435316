"""Claim: everything in the tutorial runs as it stands, and the plug-in gives the numbers of the system in Python."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench import plugins
from nlbench.cli.app import app
from tests.small_runs import table_bytes

TUTORIAL = (Path(__file__).parents[2] / "docs" / "tutorial.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TUTORIAL, re.DOTALL)


@pytest.fixture(scope="module")
def followed(tmp_path_factory):
    """The folder in which all steps were taken, in their order, and what the commands printed."""
    folder = tmp_path_factory.mktemp("mine")
    printed = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        names: dict = {}
        for program in blocks("python"):
            file = re.match(r"# (\w+\.py)\n", program)
            if file:
                Path(file.group(1)).write_text(program)
            else:
                exec(compile(program, "docs/tutorial.md", "exec"), names)
        (experiment,) = blocks("yaml")
        Path("van_der_pol.yaml").write_text(experiment)
        for line in "".join(blocks("sh")).splitlines():
            program, *arguments = shlex.split(line)
            assert program == "nlbench"
            done = CliRunner().invoke(app, arguments)
            assert done.exit_code == 0, f"{line}\n{done.output}"
            printed[line] = done.stdout
        plugins.forget()
    return folder, names["results"], printed


def test_the_claims_are_decided_and_the_figure_is_a_picture(followed):
    folder, results, _ = followed
    claims = nb.Results(folder / results.path).claims
    assert list(claims["verdict"]) == ["confirmed", "confirmed"]
    picture = matplotlib.image.imread(folder / "velocity.png")
    assert min(picture.shape[:2]) > 200
    assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 50
    assert (folder / results.path / "report.html").stat().st_size > 100_000


def test_the_plugin_gives_the_same_numbers_as_the_system_in_python(followed):
    folder, results, _ = followed
    first, second = sorted((folder / "results" / "van-der-pol").iterdir())
    assert results.path.name in (first.name, second.name)
    assert table_bytes(first) == table_bytes(second)


def test_the_commands_say_what_the_text_says_they_do(followed):
    _, _, printed = followed
    said = "\n".join(printed.values())
    assert "van_der_pol.yaml: valid" in said
    assert "C1  confirmed  curvature matters" in said
    assert "factor a of the covariance before each update" in said
