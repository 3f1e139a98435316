"""Claim: an entry has the claims that name it, its pictures, and the verdict that the rules give."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from nlbench.reproduce import documents
from nlbench.reproduce.documents import Item, Source
from nlbench.reproduce.driver import Outcome
from nlbench.reproduce.jobs import Chosen, Job
from nlbench.reproduce.summarise import Call, summarise
from nlbench.reproduce.verdicts import CLAIMS_ONLY, DIFFERS, INCONCLUSIVE, NOT_TESTABLE
from tests import synthetic_run

CLAIMS = [
    {"id": "C1", "says": "holds", "statistic": "rms", "less": ["third-order", "second-order"], "figures": ["7.18"]},
    {"id": "C2", "says": "fails", "statistic": "rms", "less": ["second-order", "third-order"], "figures": ["7.19"]},
    {"id": "C3", "says": "by chance", "statistic": "rms", "of": ["third-order"], "below": 0.1, "figures": ["7.20"],
     "where": "page 1"},
    {"id": "C4", "says": "ours", "statistic": "rms", "of": ["third-order"], "above": 0.1, "whose": "ours"},
]  # fmt: skip
VERDICTS = {"C1": "confirmed", "C2": "refuted", "C3": "refuted", "C4": "refuted"}
SHARES = {"C1": 0.9, "C2": 0.01, "C3": 0.4, "C4": 0.0}
FIGURES = ("7.18", "7.19", "7.20", "7.21")


def tables():
    claims = [
        (each["id"], each["says"], VERDICTS[each["id"]], 0.1, 0.05, 0.15, 20_000, each.get("where", ""),
         each.get("whose", "source"), " ".join(each.get("figures", ())))
        for each in CLAIMS
    ]  # fmt: skip
    columns = ["id", "says", "verdict", "estimate", "low", "high", "n", "where", "whose", "figures"]
    sets = [(id, runs, 2000, share, share, share) for id, share in SHARES.items() for runs in (10, 80)]
    return {
        "claims": pd.DataFrame(claims, columns=columns),
        "sets": pd.DataFrame(sets, columns=["id", "runs", "sets", "share", "low", "high"]),
    }


@pytest.fixture
def made(tmp_path):
    """A summary of four figures of one finished run, one of a failed one, and one without data."""
    results = synthetic_run.results(
        tmp_path / "run", tables=tables(), claims=CLAIMS, question="Which?",
        source={"document": "culver-1969", "figures": list(FIGURES), "runs": 80},
    )  # fmt: skip
    svg = '<svg xmlns="http://www.w3.org/2000/svg"><title id="t">Errors &amp; more</title>'
    svg += '<desc id="d">From low to high.</desc><path d="M 0 0 L 9 9"/></svg>'
    (results.path / "figures").mkdir()
    (results.path / "figures" / "rms-x.svg").write_text(svg)
    file = tmp_path / "file.yaml"
    file.write_text("# Which?\n# chosen: all\n")
    job = Job("culver/here", file, (), results.experiment, 20_000, results.path)
    lost = job._replace(name="culver/lost", folder=tmp_path / "nowhere")
    entries = (
        *(
            Item(figure=each, caption=each, experiments=("culver/here",), pictures=("rms-x", "rms-y"))
            for each in FIGURES
        ),
        Item(figure="7.22", caption="lost", experiments=("culver/here", "culver/lost"), pictures=("rms-x",)),
        Item(figure="8.13", caption="drawn", reason="a diagram without data"),
    )
    source = Source(name="culver-1969", title="A thesis", citation="1969", entries=entries)
    outcomes = {"culver/here": Outcome(job, 0, "", 1.0), "culver/lost": Outcome(lost, 1, "it broke", 1.0)}
    call = Call("quick", tmp_path / "out", "nlbench reproduce", 2.0)
    return summarise(Chosen(((source, entries),), ()), [job, lost], outcomes, call)


def test_each_entry_gets_the_verdict_of_the_claims_that_name_it(made):
    assert {entry.number: entry.verdict for entry in made.entries} == {
        "7.18": CLAIMS_ONLY,
        "7.19": DIFFERS,
        "7.20": INCONCLUSIVE,
        "7.21": NOT_TESTABLE,
        "7.22": NOT_TESTABLE,
        "8.13": NOT_TESTABLE,
    }
    assert made.totals == {
        "REPRODUCED": 0, CLAIMS_ONLY: 1, INCONCLUSIVE: 1, DIFFERS: 1, NOT_TESTABLE: 3,
    }  # fmt: skip
    assert [claim.id for claim in made.entries[0].claims] == ["C1", "C4"]


def test_a_claim_has_its_numbers_its_test_in_words_and_the_shares_of_sets(made):
    claim = made.entries[2].claims[0]
    assert (claim.id, claim.where, claim.n, claim.source_runs) == ("C3", "page 1", 20_000, 80)
    assert claim.test == "rms at t = 1, 2: of third-order, < 0.1"
    assert claim.form == "below"
    assert claim.source_share == 0.4
    assert [share.runs for share in claim.shares] == [10, 80]
    assert claim.standing == "inconclusive"


def test_what_failed_is_named(made):
    assert made.entries[4].because == "Not tested: culver/lost failed."
    assert made.experiments["culver/lost"].fault == "it broke"
    assert made.experiments["culver/lost"].folder is None


def test_pictures_are_those_that_there_are_with_their_words(made, tmp_path):
    (picture,) = made.entries[0].pictures
    assert (picture.name, picture.title, picture.description) == (
        "rms-x",
        "Errors & more",
        "From low to high.",
    )
    assert picture.small == tmp_path / "out" / "figures" / "culver-1969-figure-7-18-rms-x.svg"
    assert picture.small.exists()
    assert (tmp_path / "out" / "figures" / "culver-1969-figure-7-22-here-rms-x.svg").exists()


def test_pictures_of_an_earlier_summary_go(made, tmp_path):
    stale = tmp_path / "out" / "figures" / "culver-1969-figure-7-99-rms-x.svg"
    stale.write_text("")
    made_again = summarise(Chosen((), ()), [], {}, Call("quick", tmp_path / "out", "", 0.0))
    assert made_again.entries == ()
    assert not stale.exists()


def test_an_experiment_is_told_with_its_file_and_its_tables(made, tmp_path):
    run = made.experiments["culver/here"]
    assert (run.question, run.text, run.runs) == ("Which?", "# Which?\n# chosen: all\n", 20_000)
    assert tmp_path / "run" / "tables" / "claims.csv" in run.csv
    assert made.computing == pytest.approx(12.3)
    assert ("jax", "0.10.2") in made.environment
    assert ("xla flags", "--one --two") in made.environment


def test_a_picture_that_needs_no_run_is_drawn(tmp_path):
    source = documents.source("culver-1969")
    items = tuple(item for item in source.entries if item.number == "2.1")
    made = summarise(Chosen(((source, items),), ()), [], {}, Call("quick", tmp_path, "", 0.0))
    (picture,) = made.entries[0].pictures
    assert Path(picture.svg).read_text().count("<svg") == 1
    assert picture.png.exists()
    assert picture.description


def test_slugs_are_unique_and_fit_for_addresses():
    from nlbench.reproduce.summary import Entry

    entries = [
        Entry(name, item.kind, item.number, "", "", "", "", (), (), ())
        for name in documents.NAMES
        for item in documents.source(name).entries
    ]
    slugs = [entry.slug for entry in entries]
    assert len(set(slugs)) == len(slugs)
    assert all(slug.replace("-", "").isalnum() and slug.isascii() for slug in slugs)
