"""Claims: what is compared, what is left out and named, and which changes are called what."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import nlbench as nb
from nlbench.comparison.change import Measured
from nlbench.comparison.compared import Asked, compared_sides
from nlbench.comparison.significance import Change
from nlbench.comparison.verdicts import verdict
from nlbench.errors import ConfigError, NothingCompared
from nlbench.statistics.comparisons import Quantity
from tests.comparison import made

ERROR = made.errors(1, 1000)
USUAL = Asked(0.01, 0.01)


def verdicts(a, b, asked=USUAL):
    table = compared_sides(a, b, asked).table
    return {(row.filter, row.time, row.statistic): row.verdict for row in table.itertuples()}


def test_a_run_compared_with_itself_is_equal():
    done = compared_sides(made.side(ERROR, 1), made.side(ERROR, 1), Asked(0.0, 0.01))
    assert done.identical
    assert set(done.table["verdict"]) == {"="}
    assert len(done.table) == 3 * (2 + 1)
    assert done.tests == 0


def test_rounding_is_no_change():
    noise = 1 + 1e-12 * np.random.default_rng(2).normal(size=ERROR.shape)
    done = compared_sides(made.side(ERROR, 1), made.side(ERROR * noise, 1), Asked(0.0, 0.01))
    assert not done.identical
    assert set(done.table["verdict"]) == {"="}


@pytest.mark.parametrize("seed", [1, 2], ids=["paired", "apart"])
def test_a_change_from_zero_is_judged_by_its_standard_error(seed):
    """Nothing is relative to zero; a mean that differs from it by chance is no change."""
    asked = Asked(0.01, 0.01, ["mean_error", "rms"])
    table = compared_sides(made.side(0 * ERROR, 1), made.side(ERROR, seed), asked).table
    assert table["ratio"].isna().all()
    said = table.groupby("statistic")["verdict"].unique().map(list).to_dict()
    assert said == {"mean_error": ["~"], "rms": ["worse"]}
    biased = compared_sides(made.side(0 * ERROR, 1), made.side(ERROR + 0.5, seed), asked).table
    assert set(biased["verdict"]) == {"worse", "changed"}


def test_worse_better_and_slight_changes_are_told_apart():
    scale = np.array([1.03, 0.97, 1.005])[:, None, None] * (
        1 + 0.001 * np.random.default_rng(2).normal(size=ERROR.shape)
    )
    done = compared_sides(made.side(ERROR, 1), made.side(ERROR * scale, 1), USUAL)
    said = {(row.filter, row.statistic): row.verdict for row in done.table.itertuples()}
    assert said == {
        ("f1", "rms"): "worse",
        ("f2", "rms"): "better",
        ("f3", "rms"): "slight",
        **{(label, "diverged"): "=" for label in ("f1", "f2", "f3")},
    }
    assert list(dict.fromkeys(done.table["verdict"])) == ["worse", "slight", "better", "="]
    assert len(done.failing()) == 2
    assert len(done.failing(two_sided=True)) == 4
    worst = done.table.iloc[0]
    assert worst["ratio"] == pytest.approx(1.03, abs=2e-4)
    assert worst["low"] < worst["ratio"] < worst["high"]
    assert bool(worst["paired"])


@pytest.mark.parametrize(
    ("statistic", "risen", "fallen"),
    [
        ("rms_run_mean", "worse", "better"),
        ("diverged", "worse", "better"),
        ("log_likelihood", "better", "worse"),
        ("nees", "changed", "changed"),
    ],
)
def test_the_direction_decides(statistic, risen, fallen):
    quantity = Quantity("f", 1.0, "all", statistic)
    for b, said in ((-1.5, risen), (-2.5, fallen)):
        row = Measured(quantity, -2.0, b, 100, 100, False, Change(0.25, 0.01, 99.0))
        assert verdict(row, significant=True, beyond=True) == said
        assert verdict(row, significant=True, beyond=False) == "slight"
        assert verdict(row, significant=False, beyond=False) == "~"


def test_fractions_of_diverged_runs_within_the_margin_pass():
    lost = np.zeros((2, *ERROR.shape), bool)
    lost[0, :, :, :500], lost[1, :, :, 10:550] = True, True
    a, b = (made.side(ERROR, 1, each) for each in lost)
    for margin, said in ((0.01, "worse"), (0.1, "slight")):
        table = compared_sides(a, b, Asked(margin, 0.01)).table
        assert set(table.loc[table["statistic"] == "diverged", "verdict"]) == {said}


def test_fractions_at_other_report_times_are_of_the_common_ones():
    lost = np.zeros(ERROR.shape, bool)
    lost[:, 0, :50] = True  # at the first time only, which the other run does not have
    a = made.side(ERROR, 1, lost)
    b = made.side(ERROR, 2, np.zeros(ERROR.shape, bool), times=(1.5, 2.0))
    table = compared_sides(a, b, USUAL).table
    fractions = table[table["statistic"] == "diverged"]
    assert set(fractions["a"]) == set(fractions["b"]) == {0.0}


def test_a_larger_margin_lets_more_pass():
    b = made.side(1.03 * ERROR, 1)
    assert "worse" in verdicts(made.side(ERROR, 1), b, Asked(0.02, 0.01)).values()
    assert "worse" not in verdicts(made.side(ERROR, 1), b, Asked(0.04, 0.01)).values()


def test_fewer_runs_of_the_same_seed_are_compared_on_those_that_both_have():
    table = compared_sides(made.side(ERROR, 1), made.side(ERROR[..., :300], 1), USUAL).table
    assert set(table["verdict"]) == {"="}
    assert set(table["n_a"]) == set(table["n_b"]) == {300}


def test_errors_without_a_clip_are_compared_on_the_runs_that_neither_has_lost():
    lost = np.zeros(ERROR.shape, bool)
    lost[0, :, :100] = True
    a = made.side(ERROR, 1, clip={"x": None})
    b = made.side(np.where(lost, 1e6, ERROR), 1, lost, clip={"x": None})
    for first, second in ((a, b), (b, a)):
        table = compared_sides(first, second, USUAL).table
        rms = table[(table["filter"] == "f1") & (table["statistic"] == "rms")]
        assert set(rms["verdict"]) == {"="}
        assert set(rms["n_a"]) == set(rms["n_b"]) == {900}


def test_where_few_runs_are_kept_the_tables_are_used_if_they_say_more():
    many = made.errors(3, 20_000, filters=1)
    other = made.errors(4, 20_000, filters=1)
    sides = [made.side(each, 1, kept=200) for each in (many, other)]
    table = compared_sides(*sides, USUAL).table
    rms = table[table["statistic"] == "rms"]
    assert not rms["paired"].any()
    assert set(rms["n_a"]) == {20_000}
    near = made.side(many * (1 + 1e-4 * other), 1, kept=200)
    table = compared_sides(sides[0], near, USUAL).table
    rms = table[table["statistic"] == "rms"]
    assert rms["paired"].all()
    assert set(rms["n_a"]) == {200}


def test_a_filter_that_failed_in_one_run_only_is_said_so_and_never_averaged():
    gone = np.zeros(ERROR.shape, bool)
    gone[1] = True
    a, b = made.side(ERROR, 1), made.side(np.where(gone, np.nan, ERROR), 1, gone)
    said = verdicts(a, b)
    assert said["f2", "any", "diverged"] == "FAILED"
    assert sum(key[0] == "f2" for key in said) == 1
    assert compared_sides(a, b, USUAL).table.iloc[0]["verdict"] == "FAILED"
    assert verdicts(b, a)["f2", "any", "diverged"] == "recovered"
    both = compared_sides(b, b, USUAL)
    assert "f2" not in set(both.table["filter"])
    assert "failed in both, so not compared: f2" in both.notes


def test_a_filter_without_a_number_at_one_time_failed_there():
    gone = np.zeros(ERROR.shape, bool)
    gone[0, 1, :] = True
    gone[0, 1, 0] = False  # one run is left: of too few to test
    a, b = (
        made.side(ERROR, 1, clip={"x": None}),
        made.side(np.where(gone, np.nan, ERROR), 2, gone, clip={"x": None}),
    )
    assert verdicts(a, b)["f1", "2.0", "rms"] == "few"
    gone[0, 1, 0] = True
    never = made.side(np.where(gone, np.nan, ERROR), 2, gone, clip={"x": None})
    never._divergence.loc["f1", "diverged"] = 999  # not lost altogether: it had numbers at the first time
    assert verdicts(a, never)["f1", "2.0", "rms"] == "FAILED"


def test_errors_are_clipped_for_filters_that_diverged():
    lost = np.zeros(ERROR.shape, bool)
    lost[2, 0, 5] = True
    said = verdicts(made.side(ERROR, 1), made.side(ERROR, 1, lost))
    assert {key[2] for key in said if key[0] == "f3"} == {"rms_clipped", "diverged"}
    assert {key[2] for key in said if key[0] == "f1"} == {"rms", "diverged"}
    unlike = verdicts(made.side(ERROR, 1), made.side(ERROR, 1, lost, clip={"x": 4.0}))
    assert {key[2] for key in unlike if key[0] == "f3"} == {"rms", "diverged"}


def test_other_statistics_are_compared_on_request():
    shifted = ERROR + 0.5
    a, b = made.side(ERROR, 1), made.side(shifted, 1)
    said = verdicts(a, b, Asked(0.01, 0.01, ["mean_error"]))
    assert set(said.values()) == {"changed"}
    assert {key[2] for key in said} == {"mean_error"}
    everything = verdicts(a, b, Asked(0.01, 0.01, "all"))
    assert {key[2] for key in everything} == {"rms", "rms_clipped", "mean_error", "nis", "diverged"}
    with pytest.raises(ConfigError, match="unknown statistic 'rmse'; did you mean 'rms'"):
        verdicts(a, b, Asked(0.01, 0.01, "rmse"))


def test_all_that_is_wrong_with_the_question_is_said_at_once():
    with pytest.raises(ConfigError) as error:
        verdicts(made.side(ERROR, 1), made.side(ERROR, 1), Asked(-1.0, 1.5, "rmse"))
    assert len(str(error.value).splitlines()) == 3


def test_what_only_one_run_has_is_named():
    a = made.side(ERROR, 1, times=(0.5, 2.0), versions={"jax": "0.10.1"}, units={"x": "m", "y": "m"})
    b = made.side(ERROR[:2], 1, fingerprint={"xla_flags": "--two"})
    done = compared_sides(a, b, USUAL)
    assert set(done.table["filter"]) == {"f1", "f2"}
    assert set(done.table["time"]) == {"2.0", "any"}
    notes = "\n".join(done.notes)
    for told in (
        "filters in A only: f3",
        "report times in A only: 0.5",
        "report times in B only: 1",
        "coordinates in A only: y",
        "jax: 0.10.1 in A, 0.10.2 in B",
        "xla_flags: --one in A, --two in B",
    ):
        assert told in notes


def test_other_units_are_not_compared():
    with pytest.raises(NothingCompared) as error:
        verdicts(made.side(ERROR, 1), made.side(ERROR, 1, units={"x": "km"}))
    assert "x (m)" in str(error.value)
    assert "x (km)" in str(error.value)
    more = {"units": {"x": "m", "y": "m"}}, {"units": {"x": "m", "y": "km"}}
    done = compared_sides(made.side(ERROR, 1, **more[0]), made.side(ERROR, 1, **more[1]), USUAL)
    assert "unit of y: m in A, km in B; it is not compared" in done.notes


def test_nothing_in_common_says_what_each_has():
    other = made.side(ERROR, 1, times=(0.5, 1.5))
    with pytest.raises(NothingCompared) as error:
        verdicts(made.side(ERROR, 1), other)
    assert "report times: 1, 2" in str(error.value)
    assert "report times: 0.5, 1.5" in str(error.value)


def test_too_few_runs_are_nothing_compared():
    few = [made.side(ERROR[..., i : i + 20], i) for i in (0, 500)]
    for asked in (USUAL, Asked(0.01, 0.01, "rms")):
        with pytest.raises(NothingCompared, match="fewer than 30 runs"):
            verdicts(*few, asked)


def test_the_public_function_gives_the_table(tmp_path):
    a, b = (made.folder(tmp_path / name, made.side(f * ERROR, 1)) for name, f in (("a", 1.0), ("b", 1.03)))
    table = nb.compare(a, b)
    assert isinstance(table, pd.DataFrame)
    assert list(table["verdict"][:2]) == ["worse", "worse"]
    assert set(nb.compare(a, b, margin=0.05, statistics="rms")["verdict"]) == {"slight"}
