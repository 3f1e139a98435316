"""Claim: the report shows every estimated and actual moment of a vector's errors, in the layout of the thesis."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pandas as pd
import pytest

from nlbench import report
from nlbench.figures import data
from nlbench.report.moments import moments
from tests import synthetic_run

COORDINATES = {"altitude": "ft", "range": "ft", "damping": ""}
CAPTIONS = [
    "Estimated second moments",
    "Mean estimation error",
    "Actual second moments",
    "Estimated third moments",
    "Actual third moments",
]
FACTORS = {"linearised-kalman": 1.3, "third-order": 1.0}


def table(filters, coordinates, times=(1.0, 2.0)):
    """A value of its own for every entry; linearised-kalman has no third moments."""
    numbers = range(1, len(coordinates) + 1)
    components = [
        each for order in (2, 3) for each in itertools.combinations_with_replacement(numbers, order)
    ]
    rows = []
    for place, (label, time, component) in enumerate(itertools.product(filters, times, components)):
        stated = 0.0 if label == "linearised-kalman" and len(component) == 3 else -1.5e-6 * (place + 1)
        indices = ",".join(map(str, component))
        rows.append((label, time, indices, stated, 12345.678 * (place + 1), 12.3456 * (place + 1), 1234))
    columns = ["filter", "time", "indices", "estimated", "actual", "stderr", "n"]
    return pd.DataFrame(rows, columns=columns)


def results(folder, filters=FACTORS, coordinates=COORDINATES, **experiment):
    statistics = synthetic_run.statistics(filters, coordinates, 20_000)
    statistics.loc[statistics["statistic"] == "mean_error", "value"] *= -0.5
    tables = {"moments": table(filters, coordinates), "statistics": statistics}
    return synthetic_run.results(folder, filters, coordinates=coordinates, tables=tables, **experiment)


@pytest.fixture
def shown(tmp_path):
    run = results(tmp_path)
    return moments(run.table("moments"), data.read(run))


def test_a_block_has_the_layout_of_the_thesis(shown):
    assert [at.time for at in shown.times] == ["1\u00a0s", "2\u00a0s"]
    for at in shown.times:
        assert [block.filter for block in at.blocks] == list(FACTORS)
        for block in at.blocks:
            assert [group.caption for group in block.groups] == CAPTIONS
            assert block.runs == "1,234 of 20,000 runs"
    of_third_order = shown.times[1].blocks[1].groups
    numbers = [[entry.numbers for entry in group.entries] for group in of_third_order]
    pairs = ["11", "12", "13", "22", "23", "33"]
    triples = ["111", "112", "113", "122", "123", "133", "222", "223", "233", "333"]
    assert numbers == [pairs, ["1", "2", "3"], pairs, triples, triples]
    assert of_third_order[0].entries[1].names == "altitude · range"
    assert shown.legend == [(1, "altitude\u00a0(ft)"), (2, "range\u00a0(ft)"), (3, "damping")]


def test_every_number_is_that_of_the_tables(shown):
    rows = table(FACTORS, COORDINATES).set_index(["time", "filter", "indices"])
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")

    def number(text):
        return float(text.translate(powers).removeprefix("± ").replace(" × 10", "e"))

    seen = []
    for at in shown.times:
        for block in at.blocks:
            for group in block.groups:
                for entry in group.entries:
                    if group.caption == "Mean estimation error":
                        continue
                    row = rows.loc[float(at.time.split()[0]), block.filter, ",".join(entry.numbers)]
                    kind = group.caption.split()[0].lower()
                    assert number(entry.value) == pytest.approx(row[kind], rel=5e-5)
                    seen.append((at.time, block.filter, kind, entry.numbers))
                    if kind == "actual":
                        assert number(entry.stderr) == pytest.approx(row["stderr"], rel=5e-2)
                    else:
                        assert not entry.stderr
    assert (
        len(set(seen)) == len(seen) == 2 * (2 * 2 * (6 + 10) - 10)
    )  # without one filter's estimated third moments


def test_the_mean_error_is_that_of_the_statistics(shown):
    at_two = 0.2 * np.exp(-1.6) * 1.3
    (entry, *_) = shown.times[1].blocks[0].groups[1].entries
    assert entry.value == f"−{at_two * 100:.4f} × 10⁻²"
    assert entry.stderr.startswith("± ")


def test_third_moments_that_a_filter_does_not_carry_take_no_room(shown):
    group = shown.times[1].blocks[0].groups[3]
    assert not group.entries
    assert group.note == "all zero, as in every filter that carries none"


@pytest.mark.parametrize(("filters", "opened"), [(4, 4), (5, 1)])
def test_the_last_time_is_open_with_all_of_few_filters_or_the_first_of_many(tmp_path, filters, opened):
    run = results(tmp_path, {f"filter {place}": 1.0 for place in range(filters)}, figures=["mean_error"])
    text = report.write(run).read_text("utf-8")
    section = text[text.index('<section id="moments">') : text.index('<section id="divergence">')]
    assert '<a href="#moments">' in text
    times = re.findall(r"<details( open)?>\n<summary>At t = (\d)", section)
    assert times == [("", "1"), (" open", "2")]
    blocks = re.findall(r'<details class="block"( open)?>', section)
    assert blocks == ([" open"] * opened + [""] * (filters - opened)) * 2


def test_what_users_write_is_escaped(tmp_path):
    hostile = "<script>alert(1)</script>"
    run = results(tmp_path, {hostile: 1.0}, {"x": hostile, hostile: "ft"}, figures=["mean_error"])
    assert hostile not in report.write(run).read_text("utf-8")


def test_one_coordinate_has_no_such_section(tmp_path):
    text = report.write(results(tmp_path, coordinates={"x": ""}, figures=["mean_error"])).read_text("utf-8")
    assert 'id="moments"' not in text
    assert 'href="#moments"' not in text


def test_ten_coordinates_are_numbered_without_ambiguity(tmp_path):
    run = results(tmp_path, {"third-order": 1.0}, {f"c{place}": "" for place in range(1, 12)})
    block = moments(run.table("moments"), data.read(run)).times[0].blocks[0]
    numbers = [entry.numbers for entry in block.groups[0].entries + block.groups[3].entries]
    assert len(numbers) == len(set(numbers))
    assert {"1,11", "1,1", "1,1,1"} <= set(numbers)
