"""Claim: each of the thesis's figures has a claim of its own; an erratum is one question with few filters."""

from __future__ import annotations

from pathlib import Path

import pytest

from nlbench import config, systems

CONFIGS = Path(__file__).parents[2] / "configs"
CULVER = sorted((CONFIGS / "culver").glob("*.yaml"))
ERRATA = sorted((CONFIGS / "errata").glob("*.yaml"))
NAMES = [path.stem for path in CULVER]
DIAGRAMS = {f"8.{number}" for number in range(13, 19)}
NUMBERED = ("Erratum C", "Errata C", "Erratum S", "Errata H", "Erratum A")


def test_every_figure_of_the_thesis_has_a_claim_of_the_thesis():
    plotted, spoken_of = set(), set()
    for experiment in map(config.load, CULVER):
        kind = "table" if experiment.source.tables else "figure"
        shown = [*experiment.source.figures, *experiment.source.tables]
        plotted |= {(kind, number) for number in shown}
        for claim in experiment.claims:
            if claim.whose == "source":
                spoken_of |= {(kind, number) for number in claim.figures or shown}
    chapters = {2: range(2, 8), 7: range(1, 31), 8: range(1, 47)}
    figures = {f"{chapter}.{number}" for chapter, numbers in chapters.items() for number in numbers}
    wanted = {("figure", number) for number in figures - DIAGRAMS} | {
        ("table", f"8.{n}") for n in range(1, 5)
    }
    assert plotted == spoken_of == wanted


@pytest.mark.parametrize("path", CULVER, ids=NAMES)
def test_a_claim_of_the_thesis_says_where_it_stands_and_is_not_of_corrected_equations(path):
    for claim in config.load(path).claims:
        assert (claim.where is not None) == (claim.whose == "source"), claim.id
        if claim.where is not None:
            assert "page " in claim.where or claim.where.startswith("appendix"), claim.id
            assert "corrected" not in claim.says, claim.id
            assert not any("guarded" in label for label in claim.labels), claim.id


@pytest.mark.parametrize("path", [*CULVER, *ERRATA], ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_claims_are_about_coordinates_that_there_are(path):
    experiment = config.load(path)
    system = systems.build(experiment.system.name, **experiment.system.parameters)
    names = {each.name for each in system.coordinates}
    norms = set(getattr(system, "norms", None) or {})
    for claim in experiment.claims:
        of_norms = norms if claim.statistic in ("rms", "rms_clipped") else set()
        assert claim.coordinate is None or claim.coordinate in names | of_norms, claim.id


@pytest.mark.parametrize("path", ERRATA, ids=lambda path: path.stem)
def test_an_erratum_is_one_question_with_few_filters(path):
    experiment, text = config.load(path), path.read_text()
    assert any(number in text for number in NUMBERED)
    assert experiment.claims
    assert all(claim.whose == "ours" for claim in experiment.claims)
    assert experiment.source.document
    assert not experiment.source.figures + experiment.source.tables
    assert len(experiment.filters) <= 5
    assert experiment.monte_carlo.runs <= 20_000
    assert experiment.reference == "exact" or "No exact reference" in text
