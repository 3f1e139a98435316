"""Claim: numbers, words and defaults of a file mean what a YAML 1.2 reader takes them for."""

from __future__ import annotations

import pytest

from nlbench.config import load
from tests.example import VALID, spoiled, written

MINIMAL = "experiment: a\nsystem: culver-scalar\nfilters: [ekf]\n"


@pytest.mark.parametrize(
    ("text", "runs"),
    [
        ("1e6", 1_000_000),
        ("1E+3", 1000),
        ("20_000", 20_000),
        ("2.0e3", 2000),
        ("0x10", 16),
        ("0o10", 8),
        ("010", 10),
    ],
)
def test_a_count_may_be_written_in_every_way_that_means_a_whole_number(tmp_path, text, runs):
    experiment = load(written(tmp_path, spoiled("runs: 20_000", f"runs: {text}")))
    assert experiment.monte_carlo.runs == runs
    assert type(experiment.monte_carlo.runs) is int


@pytest.mark.parametrize(
    ("text", "step"), [("1e-3", 0.001), ("2E-2", 0.02), (".02", 0.02), ("2.0e-02", 0.02)]
)
def test_a_number_may_be_written_in_every_way_that_means_one(tmp_path, text, step):
    assert load(written(tmp_path, spoiled("step: 0.02", f"step: {text}"))).time.step == step


def test_on_and_yes_are_words(tmp_path):
    text = spoiled("third 3 sigma", "yes").replace("surpasses the others", "on")
    assert load(written(tmp_path, text)).labels[1] == "yes"


def test_the_question_is_the_first_comment(tmp_path):
    path = written(tmp_path, "# yaml-language-server: $schema=x\n\n#  Which is better?  \n# more\n" + MINIMAL)
    assert load(path).question == "Which is better?"
    assert load(written(tmp_path, MINIMAL + "# not this\n")).question == ""


def test_three_keys_are_enough_and_the_rest_follows_from_the_system(tmp_path):
    experiment = load(written(tmp_path, MINIMAL))
    interval = experiment.system.parameters["interval"]
    assert experiment.time.output == interval
    assert experiment.time.step == pytest.approx(interval / 10, rel=1e-12)
    assert experiment.report_times == [experiment.time.end]
    assert (experiment.monte_carlo.runs, experiment.monte_carlo.seed) == (1000, 1969)
    assert (experiment.engine.block, experiment.engine.precision, experiment.limits.diverged) == (
        64,
        "float64",
        1.0,
    )


def test_parameters_and_options_are_filled_in(tmp_path):
    experiment = load(written(tmp_path, VALID))
    assert experiment.system.parameters["dynamics"] == "nonlinear"
    assert experiment.filters[1].options["limiter"] == 3.0
    assert experiment.filters[1].options["limiter_scope"] == "all"
    assert experiment.filters[2].options["guard"] == "sub1"
    assert experiment.labels == ("linearised-kalman", "third 3 sigma", "third-order-guarded", "exact")


def test_output_times_start_at_zero_and_report_times_are_among_them(tmp_path):
    times, reports = load(written(tmp_path, VALID)).layout_times()
    assert times[:4] == (0.0, 0.1, 0.2, 0.3)
    assert [times[index] for index in reports] == [0.5, 1.0, 1.5, 2.0]
    assert len(times) == 21


def test_a_claim_without_times_is_about_all_report_times(tmp_path):
    experiment = load(written(tmp_path, spoiled("    at: [1.0, 2.0]\n", "")))
    assert experiment.claims[0].at == [0.5, 1.0, 1.5, 2.0]


def test_a_variance_is_a_diagonal_covariance(tmp_path):
    experiment = load(written(tmp_path, VALID + "initial: {mean: 2, variance: 0.16}\n"))
    assert experiment.initial == {"mean": [2.0], "cov": [[0.16]]}


def test_an_alias_repeats_what_it_names(tmp_path):
    text = spoiled("interval: 0.1", "interval: &dt 0.1").replace("output: 0.1", "output: *dt")
    assert load(written(tmp_path, text)) == load(written(tmp_path, VALID))


def test_overrides_replace_values_in_their_order(tmp_path):
    path = written(tmp_path, VALID)
    experiment = load(
        path,
        [
            "monte_carlo.runs=1e5",
            "monte_carlo.runs=64",
            "filters.0.limiter=2",
            "filters[1].label=b",
            "reference=null",
        ],
    )
    assert experiment.monte_carlo.runs == 64
    assert experiment.filters[0].options["limiter"] == 2.0
    assert experiment.labels == ("linearised-kalman", "b", "third-order-guarded")
    assert load(path, ["engine.threads=2"]).engine.threads == 2
