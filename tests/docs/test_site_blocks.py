"""Claim: every block of code in the documentation runs: Python, experiments, and commands as far as they are read."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import NamedTuple

import pytest

from nlbench import config

ROOT = Path(__file__).parents[2]
# Written elsewhere and run by tests of their own, or records that show no code to be copied.
OWN_TESTS = {"tutorial.md", "cluster.md", "performance.md", "findings.md"}
PAGES = sorted(
    path
    for path in (ROOT / "docs").rglob("*.md")
    if "decisions" not in path.parts and path.name not in OWN_TESTS
)
EVERY_PAGE = sorted((ROOT / "docs").rglob("*.md")) + [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
FENCE = re.compile(r"(<!-- long -->\n)?^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
LANGUAGES = {"python", "yaml", "sh", "json"}


class Block(NamedTuple):
    """A block of code. `long`: whether it takes too long for the quick tests."""

    language: str
    text: str
    long: bool


def blocks(page: Path) -> list[Block]:
    return [Block(kind, text, bool(long)) for long, kind, text in FENCE.findall(page.read_text())]


def of(language: str) -> list:
    return [
        pytest.param(page, id=page.name)
        for page in PAGES
        if any(b.language == language for b in blocks(page))
    ]


def run(page: Path, long: bool) -> None:
    names: dict = {}
    for block in blocks(page):
        if block.language == "python" and (long or not block.long):
            exec(compile(block.text, page.name, "exec"), names)


def test_every_block_is_of_a_kind_that_is_tried():
    assert {block.language for page in PAGES for block in blocks(page)} == LANGUAGES
    fences = sum(len(re.findall(r"^```\w", page.read_text(), re.MULTILINE)) for page in PAGES)
    assert fences == sum(len(blocks(page)) for page in PAGES)


@pytest.mark.parametrize("page", of("python"))
def test_python_blocks_run_one_after_the_other(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(page, long=False)
    assert capsys.readouterr().out.strip()


@pytest.mark.long
@pytest.mark.parametrize("page", of("python"))
def test_python_blocks_run_the_long_ones_too(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(page, long=True)
    assert "rms" in capsys.readouterr().out


@pytest.mark.parametrize("page", of("yaml"))
def test_yaml_blocks_are_experiments_and_claims_belong_to_the_one_above(page, tmp_path):
    file, text = tmp_path / "experiment.yaml", ""
    for block in blocks(page):
        if block.language == "yaml":
            text = text + block.text if block.text.startswith("claims:") else block.text
            file.write_text(text)
            assert config.load(file).question.endswith("?")


@pytest.mark.parametrize("page", of("json"))
def test_json_blocks_can_be_read(page):
    assert all(json.loads(block.text) for block in blocks(page) if block.language == "json")


def commands(page: Path) -> list[str]:
    """Lines of shell and of indented blocks, and whole commands between backticks, that call nlbench."""
    text = page.read_text()
    fenced = re.findall(r"^```(?:sh|bash|console)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    lines = [
        line.strip().removeprefix("$ ")
        for block in fenced
        for line in block.replace("\\\n", " ").splitlines()
    ]
    lines += [line.strip() for line in re.findall(r"^ {4}(nlbench .*)$", text, re.MULTILINE)]
    inline = re.findall(
        r"`(nlbench [a-z][^`\n]*)`", re.sub(r"^```.*?^```$", "", text, flags=re.DOTALL | re.MULTILINE)
    )
    return [line for line in [*lines, *inline] if line.startswith("nlbench ")]


def parsed(line: str) -> None:
    """Raises where the command line would refuse the words; runs nothing."""
    from typer.main import get_command

    from nlbench.cli.app import app

    _, name, *words = shlex.split(line.partition(" > ")[0], comments=True)
    command = get_command(app).commands[name]
    assert "--plugin" not in words or "--plugin" in [
        option for each in command.params for option in each.opts
    ]
    while (
        "--plugin" in words
    ):  # its file would be run as soon as it is read; the tutorial's own test has the file
        at = words.index("--plugin")
        del words[at : at + 2]
    # A mention such as `nlbench list` stands for the command; what follows a name must be its arguments and options.
    if words:
        command.make_context(name, words)


@pytest.mark.parametrize("page", EVERY_PAGE, ids=lambda page: page.name)
def test_commands_that_are_shown_can_be_parsed(page):
    for line in commands(page):
        parsed(line)


def test_commands_are_found_and_a_wrong_one_is_noticed(tmp_path):
    assert sum(len(commands(page)) for page in EVERY_PAGE) > 20
    page = tmp_path / "page.md"
    page.write_text("```sh\nnlbench run FILE --rusn 3\n```\nand `nlbench list filtres`\n")
    assert len(commands(page)) == 2
    for line in commands(page):
        with pytest.raises(Exception, match=r"rusn|filtres"):
            parsed(line)
