"""Claim: a traced run is drawn with every filter's error in every coordinate; one that diverges hides no other."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from nlbench import figures
from nlbench.figures import data, style, traces
from tests import synthetic_run

COORDINATES = {"altitude": "ft", "range_rate": "ft/s"}
FILTERS = ("linearised-kalman", "third-order", "exact")


def table(filters=FILTERS, runs=(0, 5), coordinates=COORDINATES, lost=None, lost_error=np.nan):
    """Errors that oscillate with amplitude 1 and a standard deviation of .7; of the lost filter, as given."""
    times = np.array(synthetic_run.TIMES)
    made = [
        pd.DataFrame(
            {
                "trajectory": run,
                "filter": label,
                "time": times,
                "coordinate": coordinate,
                "error": np.where(times > 1.0, lost_error, 0.0) if label == lost else np.cos(times + place),
                "deviation": np.nan if label == lost else 0.7,
                "diverged": (label == lost) & (times > 1.0),
            }
        )
        for run in runs
        for place, label in enumerate(filters)
        for coordinate in coordinates
    ]
    return pd.concat(made, ignore_index=True)


def results(folder, rows, filters=FILTERS, **experiment):
    factors = {label: synthetic_run.FACTORS.get(label, 1.1) for label in filters}
    return synthetic_run.results(
        folder, factors, coordinates=COORDINATES, tables={"traces": rows}, **experiment
    )


def pictures(folder, rows, filters=FILTERS):
    with style.context(salt="trace"):
        return list(traces.trace(data.read(results(folder, rows, filters))))


def test_every_traced_run_has_a_figure_in_the_order_of_the_file(tmp_path):
    drawn = figures.draw(results(tmp_path, table(runs=(5, 0))), ["trace"])
    assert [path.name for path in drawn] == ["trace-5.svg", "trace-5.png", "trace-0.svg", "trace-0.png"]


def test_the_unit_of_time_can_be_any(tmp_path):
    units = {**COORDINATES, "time": "$\\foo$"}
    run = synthetic_run.results(tmp_path, coordinates=units, tables={"traces": table()})
    assert figures.draw(run, ["trace"])


def test_runs_that_are_no_longer_traced_lose_their_figures(tmp_path):
    figures.draw(results(tmp_path, table(), figures=["trace"]))
    figures.draw(results(tmp_path, table(runs=(5,)), figures=["trace"]))
    assert {path.stem for path in (tmp_path / "figures").glob("trace*")} == {"trace-5"}


def test_a_panel_shows_the_errors_and_both_standard_deviations_of_each_filter(tmp_path):
    picture = pictures(tmp_path, table())[1]
    assert [axes.get_ylabel() for axes in picture.figure.axes] == [
        "error of\naltitude (ft)",
        "error of\nrange_rate (ft/s)",
    ]
    for axes in picture.figure.axes:
        curves = [line.get_ydata() for line in axes.lines[1:]]  # after the line at zero
        assert len(curves) == 3 * len(FILTERS)
        for place in range(len(FILTERS)):
            error, above, below = curves[3 * place : 3 * place + 3]
            np.testing.assert_array_equal(error, np.cos(np.array(synthetic_run.TIMES) + place))
            assert set(above) == {0.7}
            assert set(below) == {-0.7}


def test_of_many_filters_only_the_errors_are_drawn(tmp_path):
    filters = ("one", "two", "three", "four", "exact")
    picture = pictures(tmp_path, table(filters), filters)[0]
    assert all(len(axes.lines) == 1 + len(filters) for axes in picture.figure.axes)
    assert "thin lines" not in picture.description


@pytest.mark.parametrize("error", [50.0, -1e300, np.inf, np.nan], ids=str)
def test_a_diverged_filter_leaves_the_others_a_third_of_the_axis(tmp_path, error):
    picture = pictures(tmp_path, table(lost="third-order", lost_error=error))[0]
    for axes in picture.figure.axes:
        low, high = axes.get_ylim()
        assert -3.21 < low <= -0.99  # three times the largest error of the others, and the margin
        assert 1.0 <= high < 3.21
    legend = {text.get_text() for text in picture.figure.legends[0].get_texts()}
    assert {"diverged: third-order", "linearised-kalman", "exact"} <= legend
    assert len(figures.draw(results(tmp_path, table(lost="third-order", lost_error=error)), ["trace"])) == 4


@pytest.mark.parametrize("error", [50.0, 1e300, np.nan], ids=str)
def test_where_every_filter_diverged_they_are_drawn_all_the_same(tmp_path, error):
    rows = table(("second-order",), lost="second-order", lost_error=error)
    assert len(figures.draw(results(tmp_path, rows, ("second-order",)), ["trace"])) == 4


def test_the_words_give_the_last_errors_from_the_smallest_and_who_diverged(tmp_path):
    words = pictures(tmp_path, table(lost="third-order"))[0].description
    assert words.startswith("Errors in run 0, truth minus estimate; thin lines: plus and minus")
    first, last = np.cos(2.0), np.cos(4.0)
    assert (
        f"altitude: linearised-kalman {first:.3g} (0.7), exact {last:.3g} (0.7), third-order nan (nan)"
        in words
    )
    assert words.endswith("Diverged: third-order.")
