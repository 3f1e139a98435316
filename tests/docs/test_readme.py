"""Claim: every block of code in the README runs, and its experiment is valid."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from nlbench import config

README = (Path(__file__).parents[2] / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_python_blocks_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    programs = blocks("python")
    assert len(programs) == 3
    for program in programs:
        exec(compile(program, "README.md", "exec"), names)
    printed = capsys.readouterr().out
    assert "third-order-guarded" in printed
    assert "rms" in printed


@pytest.mark.parametrize("text", blocks("yaml"))
def test_yaml_blocks_are_valid_experiments(tmp_path, text):
    file = tmp_path / "experiment.yaml"
    file.write_text(text)
    experiment = config.load(file)
    assert experiment.question.endswith("?")


def test_commands_that_are_mentioned_exist():
    from typer.main import get_command

    from nlbench.cli.app import app

    mentioned = set(re.findall(r"nlbench ([a-z]+) (?:FILE|filters)", README))
    assert mentioned == {"validate", "plan", "run", "replay", "list"}
    assert mentioned <= set(get_command(app).commands)
