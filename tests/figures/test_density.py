"""Claim: the figure of densities shows the kept runs that count, and what each filter states of them on average."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench import figures
from nlbench.figures import style
from nlbench.figures.data import read
from nlbench.figures.density import density
from tests import synthetic_run

FACTORS = {"second-order": 1.5, "third-order": 1.0, "exact": 0.9}
RUNS = 2000


def run(folder, change=lambda table: None, coordinates=None, factors=FACTORS):
    coordinates = coordinates or {"x": "ft"}
    table = synthetic_run.kept(factors, coordinates, RUNS)
    change(table)
    return synthetic_run.results(
        folder, factors, coordinates, tables={"runs": table}, runs=RUNS, figures=["density"]
    )


def pictures(*arguments, **keywords):
    with style.context("density"):
        return list(density(read(run(*arguments, **keywords))))


def curves(axes):
    """Implied, seven moments, of the reference: those that are drawn, after the line at zero."""
    return [line.get_xydata() for line in axes.lines[1:]]


def area(curve):
    return float(curve[:, 1].sum() * (curve[1, 0] - curve[0, 0]))


def test_there_is_a_picture_for_each_coordinate_and_report_time(tmp_path):
    drawn = figures.draw(run(tmp_path, coordinates={"x": "ft", "rate": "ft/s"}))
    expected = ["density-x-1", "density-x-2", "density-rate-1", "density-rate-2"]
    assert [path.name for path in drawn] == [f"{name}.{kind}" for name in expected for kind in ("svg", "png")]


def test_a_run_from_before_the_columns_has_no_such_figure(tmp_path):
    table = synthetic_run.kept(FACTORS, {"x": ""}, RUNS).drop(columns=["x_third"])
    plain = synthetic_run.results(tmp_path, FACTORS, tables={"runs": table}, runs=RUNS)
    assert figures.draw(plain, ["density"]) == []


def test_every_density_has_the_whole_weight_but_for_the_tails(tmp_path):
    picture = pictures(tmp_path)[0]
    panels = picture.figure.axes[: len(FACTORS)]
    assert [len(curves(axes)) for axes in panels] == [3, 3, 2]  # the reference is not beside itself
    for axes in panels:
        assert [area(curve) for curve in curves(axes)] == pytest.approx([1.0] * len(curves(axes)), abs=0.04)


def test_the_bars_are_shares_of_the_runs(tmp_path):
    axes = pictures(tmp_path)[0].figure.axes[0]
    values, edges, _ = axes.patches[0].get_data()
    errors = synthetic_run.kept(FACTORS, {"x": "ft"}, RUNS)
    errors = errors.x[(errors["filter"] == "second-order") & (errors.time == 1.0)]
    inside = ((errors >= edges[0]) & (errors <= edges[-1])).mean()
    assert (values * np.diff(edges)).sum() == pytest.approx(inside, abs=1e-12)


def test_the_density_implied_is_that_of_the_moments_stated(tmp_path):
    """The variance 4 s^2/f and the third moment 8 s^3 of every run, at the middle of the figure."""
    scale = 0.1 * np.exp(-0.8)
    picture = pictures(tmp_path)[0]
    for axes, factor in zip(picture.figure.axes, FACTORS.values(), strict=False):
        e, value = curves(axes)[0].T
        variance = 4 * scale**2 / factor
        z = e / np.sqrt(variance)
        expected = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi * variance)
        expected *= 1 + 8 * scale**3 / variance**1.5 / 6 * (z**3 - 3 * z)
        np.testing.assert_allclose(value, expected, atol=2e-3 * expected.max())  # means over cells


def test_without_a_third_moment_it_is_gaussian(tmp_path):
    def change(table):
        table["x_third"] = np.nan

    e, value = curves(pictures(tmp_path, change)[0].figure.axes[0])[0].T
    assert abs(e[value.argmax()]) <= (e[1] - e[0])
    np.testing.assert_allclose(value, np.interp(-e, e, value), atol=0.02 * value.max())


def test_lost_runs_and_those_without_a_positive_variance_are_left_out_and_counted(tmp_path):
    def change(table):
        here = (table["filter"] == "second-order") & (table.time == 1.0)
        table.loc[here & (table.run < 5), "diverged"] = True
        table.loc[here & (table.run < 2), "x"] = np.nan
        table.loc[here & (table.run == 2), "x"] = 1e9
        table.loc[here & table.run.isin([4, 10, 11, 12]), "x_variance"] = [-1.0, -1.0, 0.0, np.nan]

    first, second = pictures(tmp_path, change)
    assert first.description.endswith("Runs left out: second-order 5 lost and 3 without a positive variance.")
    assert first.figure.axes[0].get_title(loc="left") == "second-order, 8 left out"
    assert "left out" not in second.description
    assert first.figure.axes[0].get_xlim()[1] < 1.0


def test_a_filter_that_lost_every_run_hides_no_other(tmp_path):
    def change(table):
        table.loc[table["filter"] == "second-order", ["x", "diverged"]] = [np.nan, True]

    picture = pictures(tmp_path, change)[0]
    assert not curves(picture.figure.axes[0])
    assert len(curves(picture.figure.axes[1])) == 3
    assert "second-order 2,000 lost" in picture.description


def test_a_run_that_states_next_to_no_variance_does_not_flatten_the_others(tmp_path):
    def change(table):
        table.loc[table.run < 400, "x_variance"] = 1e-12

    panels = pictures(tmp_path, change)[0].figure.axes[: len(FACTORS)]
    highest = max(axes.patches[0].get_data()[0].max() for axes in panels)
    assert highest < panels[0].get_ylim()[1] < 2.2 * highest


def test_the_words_say_what_is_stated_and_what_is_right(tmp_path):
    table = synthetic_run.kept(FACTORS, {"x": "ft"}, RUNS)
    rows = table[(table["filter"] == "third-order") & (table.time == 2.0)]
    third = ((rows.x - rows.x.mean()) ** 3).mean()
    words = pictures(tmp_path)[1].description
    assert words.startswith("Density of the error of x at time 2, 2,000 runs: a histogram of the errors,")
    scale = 0.1 * np.exp(-1.6)
    assert (
        f"third-order states a standard deviation of {2 * scale:.3g} and a third moment of {8 * scale**3:.3g} "
        f"where {rows.x.std(ddof=0):.3g} and {third:.3g} are right" in words
    )


def test_one_filter_alone_has_one_panel(tmp_path):
    picture = pictures(tmp_path, factors={"second-order": 1.0})[0]
    assert len(picture.figure.axes) == 1
