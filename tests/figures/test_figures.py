"""Claim: every kind of figure is drawn for every coordinate, in words too, the same to the byte each time."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import matplotlib
import pytest

from nlbench import figures
from nlbench.errors import ConfigError
from tests import synthetic_run

UNDRAWABLE = "$\\foo$"  # to a typesetter of formulas
SVG = "{http://www.w3.org/2000/svg}"
PER_COORDINATE = ("rms", "rms_clipped", "mean_error", "variance", "third_moment")
COORDINATES = {"position": "ft", "altitude_rate": "ft/s"}


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    run = synthetic_run.results(
        tmp_path_factory.mktemp("run"), coordinates=COORDINATES, diverged={"third-order": 37}
    )
    return figures.draw(run)


@pytest.fixture(scope="module")
def undiverged(tmp_path_factory):
    """A run of one coordinate in which nothing diverged, and the paths of its figures."""
    run = synthetic_run.results(tmp_path_factory.mktemp("undiverged"))
    return run, figures.draw(run)


def test_every_figure_is_drawn_for_every_coordinate(drawn):
    expected = {f"{kind}-{coordinate}" for kind in PER_COORDINATE for coordinate in COORDINATES} | {
        "divergence"
    }
    assert {path.name for path in drawn} == {f"{name}.{kind}" for name in expected for kind in ("svg", "png")}
    assert set(figures.FIGURES) == {
        *PER_COORDINATE,
        "nees",
        "divergence",
        "trace",
        "cost",
        *figures.ON_REQUEST,
    }
    assert all(path.exists() for path in drawn)


def test_the_same_tables_give_the_same_bytes(undiverged, tmp_path):
    _, first = undiverged
    second = figures.draw(synthetic_run.results(tmp_path))
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]
    assert len(first) == 8


def test_an_svg_says_in_words_what_it_shows(drawn):
    for path in drawn:
        if path.suffix == ".svg":
            root = ET.fromstring(path.read_bytes())
            assert root.get("role") == "img"
            texts = {
                child.get("id"): child.text for child in root if child.tag in (f"{SVG}title", f"{SVG}desc")
            }
            assert list(texts) == root.get("aria-labelledby").split()
            for label in synthetic_run.FACTORS:
                assert label in texts[f"{path.stem}-desc"]


def test_identifiers_of_two_figures_do_not_collide(drawn):
    seen = set()
    for path in drawn:
        if path.suffix == ".svg":
            text = path.read_text()
            here = re.findall(r'\bid="([^"]+)"', text)
            references = set(re.findall(r'href="#([^"]+)"', text)) | set(re.findall(r"url\(#([^)]+)\)", text))
            assert len(here) == len(set(here))
            assert not seen & set(here)
            assert references <= set(here)
            seen |= set(here)


def test_what_nothing_diverged_in_has_no_figure_of_divergence(undiverged):
    _, drawn = undiverged
    assert {path.stem for path in drawn} == {"rms-x", "mean_error-x", "variance-x", "third_moment-x"}


def test_pictures_that_a_run_no_longer_has_are_removed(tmp_path):
    run = synthetic_run.results(tmp_path, figures=["mean_error"])
    stale, kept = tmp_path / "figures" / "divergence.svg", tmp_path / "figures" / "notes.txt"
    stale.parent.mkdir()
    for path in (stale, kept):
        path.write_text("")
    figures.draw(run)
    assert not stale.exists()
    assert kept.exists()


def test_so_are_pictures_that_the_experiment_no_longer_asks_for(tmp_path):
    figures.draw(synthetic_run.results(tmp_path, figures=["mean_error", "final"]))
    left = figures.draw(synthetic_run.results(tmp_path, figures=["mean_error"]))
    assert sorted((tmp_path / "figures").glob("*")) == sorted(left)
    figures.draw(synthetic_run.results(tmp_path, figures=["mean_error"]), ["final"])
    assert {path.stem for path in (tmp_path / "figures").glob("*")} == {"mean_error-x", "final-x"}


def test_what_is_drawn_on_request_is_not_drawn_without_one(undiverged):
    assert set(figures.ON_REQUEST) == {"density", "response", "final"}
    run, drawn = undiverged
    assert "final-x" not in {path.stem for path in drawn}
    assert "final-x" in {path.stem for path in figures.draw(run, ["final"])}


def test_an_empty_list_of_figures_draws_none(tmp_path):
    assert figures.draw(synthetic_run.results(tmp_path, figures=[])) == []


def test_only_the_figures_asked_for_are_drawn(tmp_path):
    run = synthetic_run.results(tmp_path, figures=["mean_error"])
    assert {path.stem for path in figures.draw(run)} == {"mean_error-x"}
    assert {path.stem for path in figures.draw(run, ["variance"])} == {"variance-x"}


def test_an_unknown_figure_is_refused_with_the_known_names(tmp_path):
    with pytest.raises(ConfigError, match="unknown figure 'rsm'; known: rms, "):
        figures.draw(synthetic_run.results(tmp_path), ["rsm"])


def test_the_settings_of_matplotlib_neither_matter_nor_change(tmp_path):
    plain = figures.draw(synthetic_run.results(tmp_path / "a"), ["rms"])
    with matplotlib.rc_context({"lines.linewidth": 9.0, "font.size": 20.0}):
        before = dict(matplotlib.rcParams)
        styled = figures.draw(synthetic_run.results(tmp_path / "b"), ["rms"])
        assert dict(matplotlib.rcParams) == before
    assert [path.read_bytes() for path in plain] == [path.read_bytes() for path in styled]


def test_any_label_can_be_drawn(tmp_path):
    labels = ["$\\frac{$", "_hidden", "<script>&\"'", "a" * 60, "100 %"]
    run = synthetic_run.results(tmp_path, dict.fromkeys(labels, 1.2), diverged={labels[0]: 3})
    for path in figures.draw(run, ["rms", "variance", "divergence"]):
        if path.suffix == ".svg":
            words = ET.fromstring(path.read_bytes()).find(f"{SVG}desc").text
            assert all(label in words for label in labels)


@pytest.mark.parametrize("coordinate", ["x", "time"])
@pytest.mark.parametrize(
    "kind", ["rms", "mean_error", "variance", "third_moment", "density", "response", "nees"]
)
def test_any_unit_can_be_drawn(tmp_path, kind, coordinate):
    units = {"x": ""}
    tables = {
        "runs": synthetic_run.kept(synthetic_run.FACTORS, units, 200),
        "responses": synthetic_run.responses(synthetic_run.FACTORS, units, (0,)),
        "consistency": synthetic_run.consistency(synthetic_run.FACTORS, 200),
    }
    run = synthetic_run.results(tmp_path, coordinates=units | {coordinate: UNDRAWABLE}, tables=tables)
    assert figures.draw(run, [kind])


def test_a_filter_without_a_usable_number_does_not_hide_the_others(tmp_path):
    tables = {"statistics": synthetic_run.statistics(synthetic_run.FACTORS, {"x": ""}, 1000)}
    lost = tables["statistics"]["filter"] == "third-order"
    tables["statistics"].loc[lost, ["value", "stderr"]] = float("nan")
    drawn = figures.draw(
        synthetic_run.results(tmp_path, tables=tables, runs=1000, diverged={"third-order": 1000})
    )
    assert len(drawn) == 12


def test_one_filter_alone_is_compared_with_nothing(tmp_path):
    drawn = figures.draw(synthetic_run.results(tmp_path, {"second-order": 1.0}), ["rms"])
    assert "relative to" not in drawn[0].read_text()


def test_experiment_files_may_name_every_kind_and_no_other():
    from typing import get_args

    from nlbench.config.schema import Figure

    assert set(get_args(Figure)) == set(figures.FIGURES)
