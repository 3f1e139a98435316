"""Claim: every block of code in the README runs, and its experiment is valid."""

from __future__ import annotations

import re
from pathlib import Path

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


def test_yaml_blocks_are_valid_experiments_and_claims_belong_to_the_one_above(tmp_path):
    file, text, claims = tmp_path / "experiment.yaml", "", 0
    for block in blocks("yaml"):
        text = text + block if block.startswith("claims:") else block
        file.write_text(text)
        experiment = config.load(file)
        assert experiment.question.endswith("?")
        claims = max(claims, len(experiment.claims))
    assert claims == 4


def test_the_data_block_goes_through_the_filters_of_the_file_above_it(tmp_path):
    from typer.testing import CliRunner

    from nlbench.cli.app import app

    (data,) = blocks("csv")
    (text,) = [text for text in blocks("yaml") if "my-oscillator" in text]
    (tmp_path / "FILE").write_text(text)
    (tmp_path / "DATA").write_text(data)
    (command,) = re.findall(r"`nlbench (filter FILE DATA [^`]*)`", README)
    files = {"FILE", "DATA", "estimates.csv"}
    done = CliRunner().invoke(
        app, [str(tmp_path / word) if word in files else word for word in command.split()]
    )
    assert done.exit_code == 0, done.stderr
    rows = (tmp_path / "estimates.csv").read_text().splitlines()
    assert len(rows) == 1 + 2 * (len(data.splitlines()) - 1)
    assert "position_innovation,velocity_innovation,nis,log_likelihood" in rows[0]


def test_every_system_is_named():
    from nlbench import systems

    assert [name for name in systems.available() if f"`{name}`" not in README] == []


def test_commands_that_are_mentioned_exist():
    from typer.main import get_command

    from nlbench.cli.app import app

    mentioned = set(re.findall(r"nlbench ([a-z]+) (?:FILE|filters)", README))
    assert mentioned == {"validate", "plan", "run", "replay", "filter", "list"}
    assert mentioned <= set(get_command(app).commands)
