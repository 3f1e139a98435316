"""Claim: the figure of consistency shows both scores of every filter, with the bounds that the table holds."""

from __future__ import annotations

import numpy as np

from nlbench import figures
from nlbench.figures import style
from nlbench.figures.consistency import nees
from nlbench.figures.data import read
from tests import synthetic_run


def picture(folder, change=lambda table: table):
    table = change(synthetic_run.consistency(synthetic_run.FACTORS, 20_000))
    run = synthetic_run.results(folder, tables={"consistency": table})
    with style.context("nees"):
        return next(nees(read(run)), None), table


def test_every_filter_has_a_curve_of_each_score(tmp_path):
    drawn, table = picture(tmp_path)
    for axes, score in zip(drawn.figure.axes, ("nees", "nis"), strict=True):
        curves = [line for line in axes.lines if len(line.get_xdata()) == len(synthetic_run.TIMES)]
        assert len(curves) == len(synthetic_run.FACTORS)
        for line, label in zip(curves, synthetic_run.FACTORS, strict=True):
            rows = table[(table["filter"] == label) & (table.score == score) & (table.time != "all")]
            np.testing.assert_allclose(line.get_ydata(), rows.value)


def test_the_band_is_that_of_the_bounds(tmp_path):
    drawn, table = picture(tmp_path)
    rows = table[(table["filter"] == "exact") & (table.score == "nees")]
    band = drawn.figure.axes[0].collections[0].get_paths()[0].vertices[:, 1]
    assert (band.min(), band.max()) == (rows.low.min(), rows.high.max())


def test_the_words_give_the_last_values_from_the_smallest(tmp_path):
    drawn, _ = picture(tmp_path)
    assert (
        "At time 2 the NEES, 2 if consistent: exact 1.8, third-order-guarded 2, third-order 2"
        in drawn.description
    )


def test_without_measurements_there_is_nees_alone(tmp_path):
    drawn, _ = picture(tmp_path, lambda table: table[table.score == "nees"])
    assert len(drawn.figure.axes) == 1
    assert drawn.title == "NEES, 20,000 runs"


def test_an_older_run_without_the_table_has_no_such_figure(tmp_path):
    assert "nees" not in {path.stem for path in figures.draw(synthetic_run.results(tmp_path))}
