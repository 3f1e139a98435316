"""Claim: a bad experiment file is answered once, with every problem, its place, and what to write instead."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench.config import from_dict, load
from nlbench.errors import ConfigError
from tests.example import VALID, spoiled, written

THREE_MISTAKES = """\
experiment: fig
system: {name: culver-scalar}
monte_carlo:
  run: 1000
filters:
  - {name: efk}
"""
HUGE = "9" * 400


def complaint(folder: Path, text: str, *overrides: str) -> str:
    """What `load` says about the text; the folder's name is left out."""
    with pytest.raises(ConfigError) as caught:
        load(written(folder, text), overrides)
    return str(caught.value).replace(f"{folder}/", "")


def test_a_misspelled_key_and_name_are_shown_with_line_caret_and_suggestion(tmp_path):
    assert complaint(tmp_path, THREE_MISTAKES) == (
        "fig.yaml:4:3: monte_carlo.run: unknown key; did you mean 'runs'?\n"
        "      run: 1000\n"
        "      ^\n"
        "fig.yaml:6:12: filters.0.name: unknown filter 'efk'; did you mean 'ekf'?\n"
        "      - {name: efk}\n"
        "               ^"
    )


def test_a_missing_section_is_told_with_the_other_problems(tmp_path):
    text = complaint(tmp_path, THREE_MISTAKES.replace("system: {name: culver-scalar}\n", ""))
    assert "fig.yaml:1:1: system: missing; expected the system, such as {name: culver-scalar}\n" in text
    assert "did you mean 'runs'?" in text
    assert "did you mean 'ekf'?" in text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("step: 0.02", "step: -0.02", "time.step: expected a number above 0, found -0.02"),
        ("step: 0.02", "step: .nan", "time.step: expected a number above 0, found .nan"),
        ("end: 2.0", "end: .inf", "time.end: expected a number above 0, found .inf"),
        ("runs: 20_000", "runs: 0", "from 1 to 9,223,372,036,854,775,807, found 0"),
        ("seed: 1969", "seed: yes", "monte_carlo.seed: expected a whole number from 0 to"),
        ("seed: 1969", "seed: true", "found true"),
        ("seed: 1969", "seed: 1.5", "found 1.5"),
        ("runs: 20_000", "runs: '20000'", "found '20000'"),
        ("limiter: 3", "limiter: no", "filters.1.limiter: expected a number above 0 or null, found 'no'"),
        ("limiter: 3", "limter: 3", "filters.1.limter: unknown key; did you mean 'limiter'?"),
        (
            "reference: exact",
            "reference: best",
            "reference: expected 'exact' or 'particles' or null, found 'best'",
        ),
        ("ensemble: matched", "ensemble: mached", "did you mean 'matched'?"),
        ("interval: 0.1", "intervall: 0.1", "system.intervall: unknown key; did you mean 'interval'?"),
        ("culver-scalar", "culver-scaler", "unknown system 'culver-scaler'; did you mean 'culver-scalar'?"),
        ("culver/hermite-01", "../../etc", "experiment: expected a name such as 'culver/hermite-01'"),
        ("culver/hermite-01", "/etc/x", "experiment: expected a name such as 'culver/hermite-01'"),
        ("culver/hermite-01", "a/.hidden", "experiment: expected a name such as 'culver/hermite-01'"),
        ('"7.18"', "7.18", "source.figures.0: expected text, found 7.18; put it in quotes: '7.18'"),
        (
            "monte_carlo: {runs: 20_000, seed: 1969}",
            "runs: 5",
            "runs: unknown key; did you mean 'monte_carlo.runs'?",
        ),
        (
            "third 3 sigma",
            "linearised-kalman",
            "filters.1.label: 'linearised-kalman' is already the label of filters.0",
        ),
        ("third 3 sigma", "exact", "filters.1.label: 'exact' is already the label of the reference"),
        ("filters:\n", "filters: []\nclaim:\n", "filters: expected a list of filters"),
        (
            "  - linearised-kalman\n",
            "  - 3\n",
            "filters.0: expected a filter's name or a mapping with one, found 3",
        ),
        (
            "output: 0.1",
            "output: 0.03",
            "time.output: 0.03 is not a multiple of time.step = 0.02; nearest: 0.02 or 0.04",
        ),
        ("interval: 0.1", "interval: 0.05", "system.interval: 0.05 is not a multiple of time.step = 0.02"),
        ("1.5, 2.0]", "1.55, 2.0]", "report_times.2: 1.55 is not a multiple of time.output = 0.1"),
        ("1.5, 2.0]", "1.5, 3.0]", "report_times.3: the report time 3 is after time.end = 2"),
        ("at: [1.0, 2.0]", "at: [1.2]", "claims.0.at.0: 1.2 is not one of the report_times (0.5, 1, 1.5, 2)"),
        ("[third-order-guarded,", "[third-order,", "no filter is labelled 'third-order'; did you mean"),
        ("statistic: rms_clipped", "statistic: rmse", "did you mean 'rms'?"),
        ("output: 0.1", "output: 1e-9", "time.output: more than 100,000 output times"),
        (
            "step: 0.02",
            "step: 1e-320",
            "time.step: expected 0 or a number from 1e-100 to 1e+100 in magnitude",
        ),
        ("limiter: 3", "step: 1e-320", "filters.1.step: expected 0 or a number from 1e-100 to 1e+100"),
        ("limiter: 3", "step: 1e-50", "filters.1.step: more than 1,000,000,000 steps; take a longer step"),
        (
            "limiter: 3",
            "limiter: -1e200",
            "filters.1.limiter: expected a number above 0 or null, found -1e+200",
        ),
        (
            "end: 2.0, step: 0.02, output: 0.1",
            f"end: {HUGE}",
            "time.end: expected a number above 0, found 999",
        ),
        (
            "runs: 80",
            f"runs: {HUGE}",
            "source.runs: expected a whole number from 1 to 9,223,372,036,854,775,807",
        ),
        ("reference: exact\n", "reference: exact\ncliams:\n", "cliams: unknown key; did you mean 'claims'?"),
    ],
)
def test_each_mistake_is_explained(tmp_path, old, new, message):
    assert message in complaint(tmp_path, spoiled(old, new))


def test_every_problem_has_a_line_a_column_and_the_text_it_stands_in(tmp_path):
    text = (
        spoiled("step: 0.02", "step: 0").replace("limiter: 3", "limiter: 0").replace("seed: 1969", "seeed: 1")
    )
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, text))
    lines = text.split("\n")
    assert [problem.line for problem in caught.value.problems] == [6, 9, 11]
    for problem, key in zip(caught.value.problems, ("0", "0", "seeed"), strict=True):
        assert problem.source_line == lines[problem.line - 1]
        assert problem.source_line[problem.column - 1 :].startswith(key)


def test_a_missing_key_is_placed_at_the_section_that_lacks_it(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(written(tmp_path, spoiled("    says: the optimal third order surpasses the others\n", "")))
    (problem,) = caught.value.problems
    assert (problem.path, problem.line) == ("claims.0.says", 14)


def test_what_a_filter_believes_and_the_truth_are_checked_like_the_system(tmp_path):
    text = (
        spoiled("label: third 3 sigma}", "model: {interval: -1, x: 2}, initial: {variance: -1}}")
        + "truth: {y: 1}\n"
    )
    text = complaint(tmp_path, text)
    for message in (
        "filters.1.model.interval: expected a number above 0, found -1",
        "filters.1.model.x: unknown key",
        "filters.1.initial.variance: expected",
        "truth.y: unknown key",
    ):
        assert message in text


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        ("{cov: [[1, 2], [2, 1]]}", "cov must be positive semidefinite"),
        ("{cov: [[1e80, 2e80], [2e80, 1e80]]}", "cov must be positive semidefinite"),
        ("{cov: [[1, 0], [0, -1]]}", "cov must be positive semidefinite"),
        ("{cov: [[1, 0.5], [0, 1]]}", "cov must be symmetric"),
        ("{cov: [[1, 0]]}", "cov must be square"),
        ("{mean: [1, 2], variance: 1}", "mean has 2 entries but the covariance 1"),
        ("{cov: [[1]], variance: 1}", "cov and variance exclude each other"),
    ],
)
def test_initial_moments_must_be_moments(tmp_path, initial, message):
    assert f"initial: {message}" in complaint(tmp_path, f"{VALID}initial: {initial}\n")


@pytest.mark.parametrize("text", [VALID, spoiled("limiter: 3", "initial: {variance: 1e200}")])
@pytest.mark.parametrize(("variance", "told"), [(".inf", "found .inf"), ("1e200", "found 1e+200")])
def test_a_variance_is_a_number_to_compute_with(tmp_path, text, variance, told):
    said = complaint(tmp_path, f"{text}initial: {{variance: {variance}}}\n")
    assert f"{told}\n    initial" in said
    assert ("filters.1.initial.variance: expected" in said) == (text != VALID)


@pytest.mark.parametrize("output", ["output", "end"])
def test_a_time_of_hundreds_of_digits_sets_no_other(tmp_path, output):
    text = f"experiment: x\nsystem: lunar-orbit\nfilters: [ekf]\ntime: {{{output}: {HUGE}}}\n"
    assert f"time.{output}: expected a number above 0, found 999" in complaint(tmp_path, text)


@pytest.mark.parametrize(
    ("traces", "message"),
    [
        ("[0, 20_000]", "traces.1: there is no run 20,000; they are 0 to 19,999"),
        ("[7, 8, 7]", "traces.2: run 7 stands twice"),
        ("[-1]", "traces.0: expected a whole number of at least 0, found -1"),
        ("[1.5]", "traces.0: expected a whole number of at least 0, found 1.5"),
        ("5", "traces: expected a list of at most 32 entries, found 5"),
        (str(list(range(33))), "traces: expected a list of at most 32 entries, found a list of 33"),
    ],
)
def test_traced_runs_must_be_runs(tmp_path, traces, message):
    assert message in complaint(tmp_path, f"{VALID}traces: {traces}\n")


def test_an_option_of_the_command_line_is_named_as_the_place(tmp_path):
    text = complaint(tmp_path, VALID, "monte_carlo.run=5", "time.step=-1", "filters.9.limiter=1", "nonsense")
    assert "--set nonsense: expected key=value" in text
    text = complaint(tmp_path, VALID, "filters.9.limiter=1", "time.step.x=1")
    assert "--set filters.9.limiter: 'filters' is a list of 3: expected an index below that" in text
    assert "--set time.step.x: 'time.step' has no keys below it" in text
    text = complaint(tmp_path, VALID, "monte_carlo.run=5", "time.step=-1")
    assert "--set monte_carlo.run: unknown key; did you mean 'runs'?" in text
    assert "--set time.step: expected a number above 0, found -1" in text


@pytest.mark.parametrize(
    "key", ["9" * 5000, f"filters.{'9' * 5000}", "a." * 5000 + "a", "time." + "b" * 5000]
)
def test_an_option_of_thousands_of_characters_is_told_in_one_line(tmp_path, key):
    text = complaint(tmp_path, VALID, f"{key}=1")
    assert text.startswith(f"--set {key[:60]} ...: ")
    assert len(text) < 1000


def test_data_without_a_file_are_told_by_their_path():
    with pytest.raises(ConfigError, match=r"^time\.step: expected a number above 0, found -1$"):
        from_dict(
            {
                "experiment": "x",
                "system": "culver-scalar",
                "filters": ["ekf"],
                "time": {"end": 2, "step": -1, "output": 0.1},
            }
        )


def test_a_long_line_is_cut_around_the_caret(tmp_path):
    text = complaint(tmp_path, spoiled("matched", "matched, " + " " * 200 + "oops: 1"))
    (_, line, caret) = text.split("\n")[:3]
    assert len(line) <= 80
    assert line[caret.index("^") :].startswith("oops")
