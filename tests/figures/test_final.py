"""Claim: the figure of the report times shows every ratio to the baseline with the interval that it has."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench import figures
from nlbench.figures import data, ratios, style
from nlbench.figures.final import final
from tests import synthetic_run

FACTORS = {"second-order": 1.5, "third-order": 1.0, "exact": 0.9}


def picture(folder, factors=FACTORS, **keywords):
    with style.context("final"):
        return next(final(data.read(synthetic_run.results(folder, factors, **keywords))))


def points(axes):
    """Positions of all points: ratio and row."""
    return np.array([line.get_xydata()[0] for line in axes.lines if line.get_marker() not in ("None", "")])


def test_it_is_drawn_where_it_is_asked_for_of_every_coordinate(tmp_path):
    run = synthetic_run.results(tmp_path, coordinates={"x": "", "rate": ""}, figures=["final"])
    assert {path.stem for path in figures.draw(run)} == {"final-x", "final-rate"}


def test_a_row_has_the_ratios_of_all_report_times(tmp_path):
    axes = picture(tmp_path).figure.axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["second-order", "third-order"]
    found = points(axes)
    # The synthetic errors are factor^min(t, 1): the same ratio at both report times.
    np.testing.assert_allclose(found[:, 0], [1.5 / 0.9, 1.5 / 0.9, 1.0 / 0.9, 1.0 / 0.9])
    assert sorted(np.round(found[:, 1])) == [0, 0, 1, 1]
    assert len(set(found[:, 1])) == 4


def test_an_interval_is_that_of_the_ratio_of_dependent_means():
    """A = B + D with independent B and D, of 10^5 sets: the standard deviation of A/B."""
    generator = np.random.default_rng(4)
    b = 2.0 + 0.02 * generator.standard_normal(100_000)
    d = 1.5 + 0.03 * generator.standard_normal(100_000)
    a = b + d
    stated = ratios.of_ratio(*(np.array(each) for each in (3.5 / 2.0, a.std(), b.std(), d.std()))) / 2.0
    assert stated == pytest.approx((a / b).std(), rel=0.01)


def test_of_a_ratio_of_one_only_the_difference_counts():
    one = np.ones(1)
    np.testing.assert_allclose(ratios.of_ratio(one, 5 * one, 7 * one, 0.3 * one), 0.3)


def test_large_ratios_have_a_logarithmic_axis(tmp_path):
    wide = picture(tmp_path / "a", {"second-order": 40.0, "third-order": 1.0, "exact": 0.9})
    assert wide.figure.axes[0].get_xscale() == "log"
    assert picture(tmp_path / "b").figure.axes[0].get_xscale() == "linear"


def test_the_words_give_every_ratio_with_its_interval(tmp_path):
    words = picture(tmp_path).description
    assert words.startswith("Clipped RMS error of x, 20,000 runs, relative to exact, with 95 % intervals: ")
    assert "second-order 1.67 (" in words
    assert "at time 1, 1.67 (" in words


def test_a_filter_without_a_usable_number_does_not_hide_the_others(tmp_path):
    tables = {"statistics": synthetic_run.statistics(FACTORS, {"x": ""}, 1000)}
    tables["statistics"].loc[tables["statistics"]["filter"] == "second-order", ["value", "stderr"]] = np.nan
    low, high = picture(tmp_path, tables=tables).figure.axes[0].get_xlim()
    assert low < 1.0 < 1 / 0.9 < high < 2.0


def test_one_filter_alone_is_compared_with_nothing(tmp_path):
    assert figures.draw(synthetic_run.results(tmp_path, {"second-order": 1.0}), ["final"]) == []
