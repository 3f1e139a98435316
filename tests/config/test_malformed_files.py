"""Claim: whatever is in the file, the answer is an experiment or clear lines with their place."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from nlbench.config import Experiment, load
from nlbench.errors import ConfigError
from tests.example import VALID, spoiled, written

LAUGHS = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{after}: &{after} [{', '.join([f'*{before}'] * 9)}]\n"
    for before, after in zip("abcdefgh", "bcdefghi", strict=True)
)
MALFORMED = {
    "empty": ("", "fig.yaml: the file is empty"),
    "comments only": ("# a question\n", "fig.yaml: the file is empty"),
    "a list": ("- 1\n", "fig.yaml:1:1: expected keys with values at the top level"),
    "a word": ("hello\n", "fig.yaml:1:1: expected keys with values at the top level"),
    "a tab": ("experiment: x\nsystem:\n\tname: y\n", "fig.yaml:3:1: a tab cannot indent YAML; use spaces"),
    "a key twice": (
        spoiled("seed: 1969", "runs: 5"),
        "fig.yaml:11:29: monte_carlo.runs: the key 'runs' stands twice (first in line 11)",
    ),
    "an open bracket": ("a: [1, 2\nb: 3\n", "fig.yaml:2:2: not valid YAML: expected ',' or ']'"),
    "an open quote": ("a: 'x\n", "fig.yaml:2:1: not valid YAML"),
    "a colon too many": ("a: b: c\n", "fig.yaml:1:5: a ':' is not allowed here"),
    "two documents": ("a: 1\n---\nb: 2\n", "fig.yaml:2:1: a second document begins here"),
    "a tag": (
        "experiment: !!python/object/apply:os.system ['true']\n",
        "the tag '!!python/object/apply:os.system'",
    ),
    "an own tag": ("experiment: !run x\n", "the tag '!run' is not allowed"),
    "a binary tag": ("experiment: !!binary aGVsbG8=\n", "the tag '!!binary' is not allowed"),
    "a list's tag on a mapping": (
        "filters: !!seq {a: 1}\n",
        "fig.yaml:1:10: filters: the tag '!!seq' is not allowed; write plain values",
    ),
    "a mapping's tag on a list": (
        "system: !!map [a, b]\n",
        "fig.yaml:1:9: system: the tag '!!map' is not allowed; write plain values",
    ),
    "a tag on a key": ("!evil experiment: x\n", "fig.yaml:1:1: experiment: the tag '!evil' is not allowed"),
    "a wrong tag on a key": ("!!int experiment: x\n", "cannot read 'experiment' as a number"),
    "a wrong tag": ("experiment: !!int x\n", "fig.yaml:1:13: experiment: cannot read 'x' as a number"),
    "an unknown alias": ("experiment: *x\n", "fig.yaml:1:13: not valid YAML: found undefined alias 'x'"),
    "a list as key": ("? [1, 2]\n: 3\n", "fig.yaml:1:3: a key must be a word"),
    "laughs": (LAUGHS, "fig.yaml: holds more than 20,000 values"),
    "an alias of itself": ("a: &a [*a]\n", "nested too deeply"),
    "deep": ("a: " + "[" * 500 + "\n", "nested too deeply"),
    "a huge number": (spoiled("seed: 1969", f"seed: {'9' * 5000}"), "as a number"),
    "a huge hexadecimal number": (spoiled("seed: 1969", f"seed: 0x{'f' * 4000}"), "as a number"),
    "a control character": ("experiment: \a\n", "fig.yaml:1:13: the character U+0007 is not allowed in YAML"),
    "zeros": (b"\0" * 100, "fig.yaml: a binary file"),
    "latin": (b"# caf\xe9\nexperiment: x\n", "fig.yaml:1:6: not text in UTF-8"),
    "utf-16": ("experiment: x\n".encode("utf-16"), "fig.yaml: a binary file"),
    "too large": ("#" * 300_000, "fig.yaml: larger than 200,000 bytes"),
}


@pytest.mark.parametrize("kind", MALFORMED)
def test_a_malformed_file_is_answered_alone_with_its_place(tmp_path, kind):
    content, message = MALFORMED[kind]
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, content))
    assert len(caught.value.problems) == 1
    assert message in str(caught.value).replace(f"{tmp_path}/", "")


def test_a_syntax_error_hides_no_other_message_behind_it(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, "run: 1\nrun: 2\n"))
    assert [problem.message for problem in caught.value.problems] == [
        "the key 'run' stands twice (first in line 1)"
    ]


def test_a_missing_file_and_a_folder_are_told_in_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot read the experiment: no such file$"):
        load(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match=r"cannot read the experiment: is a directory$"):
        load(tmp_path)


def test_control_characters_of_a_file_do_not_reach_the_terminal(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, spoiled("ensemble: matched", 'ensemble: "\\e[31m\\a", x\u0085: 1')))
    assert all(letter.isprintable() or letter == "\n" for letter in str(caught.value))


@pytest.mark.parametrize("end", ["\r", "\r\n", "\x85", "\u2028", "\u2029"])
def test_lines_are_counted_however_they_end(tmp_path, end):
    text = spoiled("seed: 1969", "seeed: 1")
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, text.replace("\n", end)))
    (problem,) = caught.value.problems
    assert (problem.line, problem.column) == (11, 29)
    assert problem.source_line == text.split("\n")[10]
    with pytest.raises(ConfigError, match=r"fig\.yaml:2:5: a ':' is not allowed here"):
        load(written(tmp_path, f"a: 1{end}b: c: d{end}"))


PIECES = [
    "~",
    "-1",
    "1e999",
    ".nan",
    "true",
    "[]",
    "{}",
    "&a",
    "*a",
    "!!int",
    ": ",
    "- ",
    "\t",
    "\n",
    "'",
    '"',
    "#",
    "\u00e9",
    "|",
    "<<",
    "0x",
]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_mutation_of_a_valid_file_is_an_experiment_or_a_config_error(tmp_path, data):
    text = VALID
    for _ in range(data.draw(st.integers(1, 4))):
        start = data.draw(st.integers(0, len(text)))
        stop = min(len(text), start + data.draw(st.integers(0, 12)))
        text = text[:start] + data.draw(st.sampled_from(PIECES) | st.text(max_size=3)) + text[stop:]
    path = written(tmp_path, text.encode("utf-8", "surrogatepass"))
    outcome = loaded(path)
    if isinstance(outcome, Experiment):
        assert outcome.layout_times()[0][0] == 0.0
    else:
        assert outcome.problems
        assert all(problem.file == str(path) for problem in outcome.problems)


def loaded(path: Path) -> Experiment | ConfigError:
    try:
        return load(path)
    except ConfigError as error:
        return error
