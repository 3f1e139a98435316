"""Claim: accuracy stands against cost, labels hide no point, and the front holds those that none beats in both."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.text import Text

from nlbench import figures
from nlbench.figures import beside, data, style
from nlbench.figures.cost import Point, cost, front
from tests import synthetic_run

FACTORS = synthetic_run.FACTORS
LAST = 0.4 * np.exp(-1.6)  # the synthetic error at time 2, in factors


def picture(folder, factors=FACTORS, table=None, **keywords):
    tables = {"cost": synthetic_run.costs(factors) if table is None else table}
    with style.context("cost"):
        return next(cost(data.read(synthetic_run.results(folder, factors, tables=tables, **keywords))), None)


def labels(drawn):
    return {text.get_text(): text for text in drawn.figure.axes[0].texts}


def test_every_filter_is_a_labelled_point(tmp_path):
    drawn = picture(tmp_path)
    found = labels(drawn)
    assert set(found) == set(FACTORS)
    for place, (label, factor) in enumerate(FACTORS.items()):
        np.testing.assert_allclose(found[label].xy, (10.0**place, LAST * factor))
    assert drawn.figure.axes[0].get_xscale() == "log"


def test_it_is_drawn_by_default_and_only_where_there_is_something_to_compare(tmp_path):
    assert "cost" not in figures.ON_REQUEST
    run = synthetic_run.results(tmp_path / "a", tables={"cost": synthetic_run.costs(FACTORS)})
    assert [path.name for path in figures.draw(run, ["cost"])] == ["cost.svg", "cost.png"]
    assert picture(tmp_path / "b", table=synthetic_run.cost()) is None  # of one filter
    assert figures.draw(synthetic_run.results(tmp_path / "c"), ["cost"]) == []  # of none


def test_it_is_the_error_of_the_first_norm_if_there_is_one(tmp_path):
    drawn = picture(tmp_path, coordinates={"x": "ft", "rate": "ft/s"})
    assert drawn.figure.axes[0].get_ylabel() == "clipped RMS error of x at time 2 (ft)"
    run = synthetic_run.results(
        tmp_path / "norm",
        coordinates={"x": "ft", "size": "ft"},
        tables={"cost": synthetic_run.costs(FACTORS)},
    )
    with style.context("cost"):
        drawn = next(cost(data.read(run)._replace(norms=("size",))))
    assert drawn.figure.axes[0].get_ylabel() == "clipped RMS error of size at time 2 (ft)"


def test_the_front_holds_those_that_no_other_beats_in_both():
    points = [
        Point(*each, 0.1) for each in (("a", 1.0, 5.0), ("b", 2.0, 6.0), ("c", 3.0, 4.0), ("d", 3.0, 3.0))
    ]
    assert [point.label for point in front(points[::-1])] == ["a", "d"]
    assert [point.label for point in front([*points, Point("e", 1.0, 5.0, 0.1)])] == ["a", "d"]


def test_the_words_give_costs_from_the_cheapest_and_the_front(tmp_path):
    words = picture(tmp_path).description
    assert words.startswith(
        "Cost and accuracy, 20,000 runs: clipped RMS error of x at time 2 against measured time"
    )
    assert f"linearised-kalman {1.3 * LAST:.3g} in 1 ns, second-order" in words
    assert words.endswith(
        "cheaper and better than: linearised-kalman, second-order, third-order, third-order-guarded, exact."
    )


def test_a_filter_without_a_usable_number_does_not_hide_the_others(tmp_path):
    table = synthetic_run.costs(FACTORS)
    table.loc[0, "ns_per_step"] = np.nan
    assert set(labels(picture(tmp_path, table=table))) == set(FACTORS) - {"linearised-kalman"}


@pytest.mark.parametrize("seed", range(3))
def test_labels_hide_neither_each_other_nor_a_point(seed):
    """Of twelve filters, by the renderer's own boxes and not by the sizes that placing them assumes."""
    generator = np.random.default_rng(seed)
    points = {f"filter number {i}": tuple(generator.random(2)) for i in range(12)}
    with style.context("cost"):
        figure = style.figure(3.4)
        axes = figure.subplots()
        axes.set(xlim=(-0.1, 1.1), ylim=(-0.1, 1.1), xlabel="cost", ylabel="error")
        beside.write(axes, points)
        figure.draw_without_rendering()
        boxes = [Text.get_window_extent(text) for text in axes.texts]  # without the line to the point
    at = axes.transData.transform(list(points.values()))
    for i, box in enumerate(boxes):
        assert not any(box.shrunk(0.9, 0.8).overlaps(other.shrunk(0.9, 0.8)) for other in boxes[i + 1 :])
        assert not any(box.contains(*point) for point in at)
        assert axes.bbox.x0 <= box.x0
        assert box.x1 <= axes.bbox.x1
