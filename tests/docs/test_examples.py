"""Claim: the workflow that is offered as an example is valid YAML and gives commands and options that there are."""

from __future__ import annotations

import re
from pathlib import Path

from ruamel.yaml import YAML
from typer.main import get_command

from nlbench.cli.app import app

WORKFLOW = Path(__file__).parents[2] / "docs" / "examples" / "benchmark.yml"


def test_the_workflow_gives_commands_and_options_that_there_are():
    steps = YAML(typ="safe").load(WORKFLOW)["jobs"]["compare"]["steps"]
    lines = " ".join(step.get("run", "").replace("\\\n", " ") + "\n" for step in steps).splitlines()
    commands = get_command(app).commands
    given = {}
    for line in lines:
        if found := re.search(r"bin/nlbench\" ([a-z]+)|bin/nlbench ([a-z]+)", line):
            given[found[1] or found[2]] = set(re.findall(r" (--[a-z-]+)", line.partition("|")[0]))
    assert set(given) == {"run", "compare", "perf"}
    for name in set(given) & set(commands):
        known = {option for each in commands[name].params for option in each.opts}
        assert given[name] <= known, name
    assert {"run", "compare"} <= set(commands)
    assert given["compare"] == {"--margin", "--alpha", "--markdown"}


def test_the_workflow_needs_no_secret_and_writes_nothing_back():
    text = WORKFLOW.read_text()
    assert "secrets." not in text
    assert YAML(typ="safe").load(text)["permissions"] == {"contents": "read"}
