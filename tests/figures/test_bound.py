"""Claim: the Cramer-Rao bound is a line of the RMS figure, in legend and words; without one nothing changes."""

from __future__ import annotations

import numpy as np
import pandas as pd

from nlbench.figures import style
from nlbench.figures.data import read
from nlbench.figures.error_curves import mean_error, rms
from tests import synthetic_run


def test_the_bound_is_drawn_in_the_rms_figure_alone(tmp_path):
    value = 0.3 * np.exp(-np.array(synthetic_run.TIMES))
    table = pd.DataFrame(
        {"time": synthetic_run.TIMES, "coordinate": "x", "statistic": "pcrb", "value": value, "n": 1024}
    )
    data = read(synthetic_run.results(tmp_path, tables={"bounds": table}))
    with style.context("rms"):
        drawn, other = next(rms(data)), next(mean_error(data))
    assert any(np.array_equal(line.get_ydata(), value) for line in drawn.figure.axes[0].lines)
    assert "Cramer-Rao bound" in [text.get_text() for text in drawn.figure.legends[0].get_texts()]
    assert f"is below: {value[-1]:.3g}." in drawn.description
    assert "Cramer-Rao bound" not in [text.get_text() for text in other.figure.legends[0].get_texts()]


def test_without_a_bound_there_is_no_line_of_it(tmp_path):
    with style.context("rms"):
        drawn = next(rms(read(synthetic_run.results(tmp_path))))
    assert "Cramer-Rao" not in drawn.description
    assert "Cramer-Rao bound" not in [text.get_text() for text in drawn.figure.legends[0].get_texts()]
