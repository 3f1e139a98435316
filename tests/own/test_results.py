"""Claim: results show themselves in a notebook, escaped, and draw the report's figures without writing anything."""

from __future__ import annotations

import numpy as np
import pytest

import nlbench as nb
from nlbench.errors import ConfigError
from tests import synthetic_run
from tests.parsed_page import Page

COORDINATES = {"angle": "rad", "<script>rate": "rad/s"}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    made = synthetic_run.results(
        folder,
        coordinates=COORDINATES,
        diverged={"second-order": 3},
        question="Is <b>bold</b> & better?",
        tables={"claims": synthetic_run.claims()},
    )
    return nb.Results(made.path)


def test_a_cell_shows_errors_divergence_and_verdicts_and_everything_is_escaped(results):
    html = results._repr_html_()
    page = Page(html)
    assert page.open == []
    assert "Is <b>bold</b> & better?" in page.text
    assert not page.all("script")
    assert len(page.all("table")) == len(COORDINATES) + 2
    table = results.table("statistics")
    end = table[
        (table["statistic"] == "rms_clipped") & (table["filter"] == "second-order") & (table["time"] == "2.0")
    ]
    assert f"{end['value'].iloc[0]:.3f}" in page.text
    assert "3 of 20,000" in page.text
    assert "confirmed" in page.text
    assert str(results.path) in page.text


def test_a_line_of_text_says_what_it_is(results):
    assert (
        repr(results) == f"Results({str(results.path)!r}): 20,000 runs of {', '.join(synthetic_run.FACTORS)}"
    )
    assert repr(nb.Results("nowhere")) == "Results('nowhere')"


def test_claims_are_a_table_or_none(results, tmp_path):
    assert list(results.claims["id"]) == list(synthetic_run.claims()["id"])
    assert nb.Results(synthetic_run.results(tmp_path).path).claims is None


def test_a_figure_has_the_curves_of_the_table_and_nothing_is_written(results):
    before = sorted(results.path.rglob("*"))
    figure = results.plot("rms", coordinate="angle", filters=["second-order", "linearised-kalman"])
    assert sorted(results.path.rglob("*")) == before
    table = results.table("statistics")
    table = table[(table["coordinate"] == "angle") & (table["statistic"] == "rms") & (table["time"] != "all")]
    drawn = [line.get_ydata() for line in figure.axes[0].lines]
    shown = {}
    for label in synthetic_run.FACTORS:
        values = table[table["filter"] == label]["value"].to_numpy()
        assert len(values) > 10
        shown[label] = any(len(y) == len(values) and np.allclose(y, values) for y in drawn)
    assert [label for label, there in shown.items() if there] == ["linearised-kalman", "second-order"]


def test_the_first_coordinate_is_drawn_where_none_is_named(results):
    assert "angle" in results.plot().axes[0].get_title(loc="left")


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"kind": "rsm"}, "unknown figure 'rsm'; did you mean 'rms'?"),
        ({"coordinate": "angel"}, "no figure 'rms' of angel; there is: angle"),
        ({"filters": ["second"]}, "no filter is labelled 'second'; did you mean 'second-order'?"),
        ({"kind": "trace"}, "no figure 'trace' of this run; there is: nothing of that kind"),
    ],
)
def test_what_is_not_there_is_said(results, asked, message):
    with pytest.raises(ConfigError) as raised:
        results.plot(**asked)
    assert str(raised.value).startswith(message)
