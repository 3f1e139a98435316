"""Claim: the hash names what was computed: stable, blind to tuning, and the resolved file gives it back."""

from __future__ import annotations

import pytest

from nlbench.config import from_dict, load
from tests.example import VALID, spoiled, written


def loaded(folder, text=VALID, *overrides):
    return load(written(folder, text), overrides)


def test_the_resolved_file_loads_as_the_same_experiment(tmp_path):
    experiment = loaded(
        tmp_path, VALID + "truth: {measurement_variance: 2}\ninitial: {variance: 1e-7}\ntraces: [5, 0]\n"
    )
    again = load(written(tmp_path, experiment.resolved_yaml(), "config.resolved.yaml"))
    assert again == experiment
    assert again.traces == [5, 0]
    assert again.hash12() == experiment.hash12()
    assert again.resolved_yaml() == experiment.resolved_yaml()


@pytest.mark.parametrize("question", ["q\rexperiment: t", "q\nfilters: []", "a\x85b\u2028c\td", "\u202eq"])
def test_a_question_is_one_line_of_the_resolved_file(tmp_path, question):
    plain = {"experiment": "t", "system": "culver-scalar", "filters": ["ekf"]}
    experiment = from_dict(plain, question)
    assert load(written(tmp_path, experiment.resolved_yaml(), "config.resolved.yaml")) == experiment
    assert experiment.question.isprintable()


def test_a_file_whose_lines_end_in_carriage_returns_is_resolved_as_another_is(tmp_path):
    text = "# q\nexperiment: t\nsystem: culver-scalar\nfilters: [ekf]\n"
    experiment = loaded(tmp_path, text.replace("\n", "\r"))
    assert experiment == loaded(tmp_path, text)
    assert loaded(tmp_path, experiment.resolved_yaml()) == experiment


TUNING = (
    *("monte_carlo.runs=7", "engine.chunk=3", "engine.threads=1"),
    *("traces=[0, 5]", "claims=[]", "source.runs=7", "figures=[rms]"),
)


@pytest.mark.parametrize("tuning", TUNING)
def test_how_many_runs_how_they_are_computed_and_how_they_are_read_do_not_change_the_hash(tmp_path, tuning):
    assert loaded(tmp_path, VALID, tuning).hash12() == loaded(tmp_path).hash12()


@pytest.mark.parametrize(
    "change",
    [
        "monte_carlo.seed=1",
        "monte_carlo.keep_runs=5",
        "engine.block=32",
        "engine.precision=float32",
        "time.step=0.01",
        "system.measurement_variance=1.7",
        "filters.0.limiter=3",
        "filters.1.label=other",
    ],
)
def test_everything_else_changes_the_hash(tmp_path, change):
    assert loaded(tmp_path, VALID, change).hash12() != loaded(tmp_path).hash12()


def test_how_it_is_written_does_not_change_the_hash(tmp_path):
    spelled_out = spoiled(
        "  - linearised-kalman", "  - {label: linearised-kalman, name: linearised-kalman, limiter: null}"
    )
    spelled_out = spelled_out.replace("end: 2.0, step: 0.02", "step: 2e-2, end: 2").replace(
        "[0.5, 1.0", "[1, 0.5"
    )
    assert loaded(tmp_path, spelled_out.replace("# Does", "# Why")).hash12() == loaded(tmp_path).hash12()


def test_the_hash_is_twelve_hexadecimal_digits(tmp_path):
    name = loaded(tmp_path).hash12()
    assert len(name) == 12
    assert set(name) <= set("0123456789abcdef")


def test_an_experiment_cannot_be_changed(tmp_path):
    with pytest.raises(ValueError, match="frozen"):
        loaded(tmp_path).experiment = "other"
