"""Claim: a claim has exactly one form with the keys that belong to it; whatever else is said in one line."""

from __future__ import annotations

import pytest

from nlbench.config import Claim, from_dict, load
from nlbench.errors import ConfigError
from tests.example import VALID, spoiled, written

LESS = "less: [third-order-guarded, linearised-kalman]"


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ("", "expected exactly one of less, equal and of, found none"),
        (
            "less: [exact, linearised-kalman], of: [exact]",
            "expected exactly one of less, equal and of, found less and of",
        ),
        ("of: [exact]", "'of' needs one of below, above, agrees_with, less_than, printed"),
        ("equal: [exact, linearised-kalman]", "'equal' needs 'within', the largest relative difference"),
        ("of: [exact], agrees_with: rms", "'agrees_with' needs 'within', the largest relative difference"),
        ("less: [exact, linearised-kalman], within: .1", "'within' does not go with 'less'"),
        ("of: [exact], below: 1, factor: 2", "'factor' does not go with 'below'"),
        ("of: [exact], below: 1, above: 2", "'above' must be less than 'below'"),
        (
            "of: [exact], printed: {'1,1': 2}",
            "'printed' goes with the statistics moment_estimated and moment_actual, only",
        ),
        ("less: [exact]", "expected a list of at least 2 entries or null, found a list of 1"),
        ("less: [exact, exakt]", "no filter is labelled 'exakt'; did you mean 'exact'?"),
        ("of: [exakt], below: 1", "no filter is labelled 'exakt'; did you mean 'exact'?"),
        ("equal: [exact, exact], within: .1", "'exact' stands twice in this claim"),
        (
            "of: [exact], below: 1, figures: ['7.20']",
            "'7.20' is not one of the figures and tables of source (7.18, 7.19)",
        ),
        ("of: [exact], below: 1, whose: mine", "expected 'source' or 'ours', found 'mine'"),
    ],
)
def test_a_claim_that_does_not_make_sense_is_refused_in_one_line(tmp_path, form, message):
    text = VALID.split("claims:")[0] + f"claims:\n  - {{id: C1, says: so, statistic: rms, {form}}}\n"
    with pytest.raises(ConfigError) as told:
        load(written(tmp_path, text))
    assert message in str(told.value)
    assert len(told.value.problems) == 1


def test_the_form_of_a_claim_is_the_key_that_decides_it():
    def form(**given):
        return Claim(id="C", says="so", statistic=given.pop("statistic", "rms"), **given).form

    assert form(less=["a", "b"]) == "less"
    assert form(equal=["a", "b"], within=0.1) == "equal"
    assert form(of=["a"], above=0.0, below=1.0) == "below"
    assert form(of=["a"], above=0.0) == "above"
    assert form(of=["a"], agrees_with="nees", within=0.1) == "agrees_with"
    assert form(of=["a"], less_than="nees") == "less_than"
    assert form(of=["a"], printed={"1,1": 1.0}, statistic="moment_actual") == "printed"


def test_the_resolved_file_states_a_claim_without_the_keys_that_it_does_not_have(tmp_path):
    plain = load(written(tmp_path, VALID)).resolved()
    assert set(plain["claims"][0]) == {"id", "says", "whose", "statistic", "at", "less"}
    assert from_dict(plain).claims == load(written(tmp_path, VALID)).claims


def test_text_of_a_claim_is_one_line(tmp_path):
    broken = spoiled("says: the optimal third order surpasses the others", 'says: "two\\nlines"')
    with pytest.raises(ConfigError, match="expected one line"):
        load(written(tmp_path, broken))
