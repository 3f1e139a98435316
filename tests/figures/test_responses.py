"""Claim: a traced run is shown as truth, estimates and measurements; what runs away hides nothing."""

from __future__ import annotations

import numpy as np
import pytest

from nlbench import figures
from nlbench.figures import data, style
from nlbench.figures.responses import response
from tests import synthetic_run

COORDINATES = {"altitude": "ft", "range_rate": "ft/s"}
FACTORS = {"second-order": 2.0, "third-order": 1.0}
OFF = {"second-order": -2.0, "third-order": 1.0}  # of the truth, in tenths
TIMES = np.array(synthetic_run.TIMES)


def pictures(folder, change=lambda table: table):
    table = change(synthetic_run.responses(OFF, COORDINATES, (5, 0)))
    run = synthetic_run.results(folder, FACTORS, COORDINATES, tables={"responses": table})
    with style.context("response"):
        return list(response(data.read(run)))


def test_every_traced_run_has_a_picture_where_it_is_asked_for(tmp_path):
    tables = {"responses": synthetic_run.responses(OFF, COORDINATES, (5, 0))}
    run = synthetic_run.results(tmp_path, FACTORS, COORDINATES, tables=tables, figures=["response"])
    names = ["response-5.svg", "response-5.png", "response-0.svg", "response-0.png"]
    assert [path.name for path in figures.draw(run)] == names


def test_an_older_run_has_none(tmp_path):
    assert figures.draw(synthetic_run.results(tmp_path), ["response"]) == []


def test_a_panel_shows_truth_and_estimates_and_the_last_one_the_measurements(tmp_path):
    panels = pictures(tmp_path)[0].figure.axes
    assert [axes.get_ylabel() for axes in panels] == ["altitude (ft)", "range_rate (ft/s)", "measurement"]
    for axes in panels[:2]:
        drawn = [line.get_ydata() for line in axes.lines]
        np.testing.assert_array_equal(drawn, [np.cos(TIMES), np.cos(TIMES) - 0.2, np.cos(TIMES) + 0.1])
    (measured,) = panels[2].lines
    np.testing.assert_array_equal(measured.get_xydata(), np.c_[TIMES[::2], 30 * np.sin(9 * TIMES[::2])])


def test_without_measurements_there_is_no_panel_of_them(tmp_path):
    picture = pictures(tmp_path, lambda table: table[table.kind != "measurement"])[0]
    assert len(picture.figure.axes) == 2
    assert picture.title == "Truth and estimates in run 5"
    assert "measurement" not in picture.description


@pytest.mark.parametrize("value", [1e9, -np.inf, np.nan], ids=str)
def test_an_estimate_that_runs_away_leaves_the_truth_half_the_axis(tmp_path, value):
    def change(table):
        late = (table["filter"] == "third-order") & (table.time > 1.0)
        return table.assign(value=table.value.where(~late, value))

    for axes in pictures(tmp_path, change)[0].figure.axes[:2]:
        low, high = axes.get_ylim()
        span = 1 - np.cos(2.0)
        assert low <= np.cos(2.0)
        assert high >= 1.0
        assert high - low < 2.3 * span


def test_the_words_give_the_last_estimates_from_the_nearest_to_the_truth(tmp_path):
    first, second = pictures(tmp_path)
    assert first.title == "Truth, estimates and measurements in run 5"
    truth = np.cos(2.0)
    ends = f"third-order {truth + 0.1:.3g}, second-order {truth - 0.2:.3g}"
    assert f"At time 2, altitude: {truth:.3g} is true; {ends}. range_rate: " in second.description
    assert "11 measurements y1 from " in second.description
