"""Claim: `nlbench compare` says which run is worse, within 80 columns, and ends with the code that a CI job needs."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from nlbench.cli.app import app
from tests.comparison import made
from tests.example import VALID, written

ERROR = made.errors(1, 400)


@pytest.fixture
def folder(tmp_path):
    """Makes the folder of a run whose errors are scaled."""

    def make(name, scale=1.0, seed=1, **manifest):
        return made.folder(tmp_path / name, made.side(ERROR * scale, seed, **manifest))

    return make


def compare(*arguments):
    return CliRunner().invoke(app, ["compare", *map(str, arguments)])


def test_a_run_and_itself_are_equal(folder):
    a = folder("a")
    done = compare(a, a)
    assert done.exit_code == 0
    assert "equal: all 9 comparisons, to the last bit" in done.stdout
    assert "B/A" not in done.stdout


def test_a_change_of_three_percent_fails(folder):
    a, b = folder("a"), folder("b", 1.03)
    done = compare(a, b)
    assert done.exit_code == 3
    assert "6 worse of 9 comparisons (margin 1 %)" in done.stdout
    assert done.stderr == "gate failed: 6 worse of 9 comparisons (margin 1 %)\n"
    assert "1.030 [1.030, 1.030]" in done.stdout
    assert "next: nlbench report" in done.stdout
    assert max(map(len, done.stdout.replace(str(a), "A").replace(str(b), "B").splitlines())) <= 80


def test_a_change_for_the_better_passes_unless_told_otherwise(folder):
    a, b = folder("a"), folder("b", 0.95)
    done = compare(a, b)
    assert done.exit_code == 0
    assert "not worse by more than 1 % (6 better)" in done.stdout
    assert compare(a, b, "--two-sided").exit_code == 3


def test_margins_are_numbers_or_percentages(folder):
    a, b = folder("a"), folder("b", 1.03)
    for margin in ("4%", "0.04", "4 %"):
        assert compare(a, b, "--margin", margin).exit_code == 0
    wrong = compare(a, b, "--margin", "much", "--alpha", "%")
    assert wrong.exit_code == 2
    assert "--margin: expected a number or a percentage such as 1%, found 'much'" in wrong.stderr
    assert "--alpha: expected a number or a percentage such as 1%, found '%'" in wrong.stderr
    assert compare(a, b, "--alpha", "0").exit_code == 2


def test_long_names_of_filters_and_coordinates_stay_within_eighty_columns(tmp_path, folder, monkeypatch):
    long = "a filter with a label that is much longer than anybody would wish for, and then some more"
    names = {"units": {"x": "m", "y": "m"}}
    sides = [made.side(ERROR * scale, 1, **names) for scale in (1.0, 1.03)]
    for number, side in enumerate(sides):
        for table in side.tables.values():
            for column in {"filter", "coordinate"} & set(table):
                table[column] = table[column].replace({"f1": long[:64]})
        made.folder(tmp_path / str(number), side)
    monkeypatch.chdir(tmp_path)
    done = compare("0", "1")
    assert done.exit_code == 3
    assert long[:64] in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80


def test_json_has_everything(folder):
    done = compare(folder("a"), folder("b", 1.03), "--json")
    facts = json.loads(done.stdout)
    assert done.exit_code == facts["exit_code"] == 3
    assert len(facts["comparisons"]) == 9
    first = facts["comparisons"][0]
    assert first["verdict"] == "worse"
    assert first["ratio"] == pytest.approx(1.03)
    assert facts["b"]["seed"] == 1


def test_markdown_is_a_table_of_whole_lines(folder):
    done = compare(folder("a"), folder("b", 1.03), "--markdown")
    assert done.exit_code == 3
    rows = [line for line in done.stdout.splitlines() if line.startswith("|")]
    assert len(rows) == 2 + 9
    assert {row.count("|") for row in rows} == {9}
    assert "\x1b" not in done.stdout


def test_nothing_in_common_ends_with_seven(tmp_path, folder):
    other = made.folder(tmp_path / "other", made.side(ERROR, 1, times=(0.5, 1.5)))
    done = compare(folder("a"), other)
    assert done.exit_code == 7
    assert "nothing in common" in done.stderr
    assert "report times: 0.5, 1.5" in done.stderr


def test_a_damaged_table_is_named(folder):
    a, b = folder("a"), folder("b")
    table = b / "tables" / "statistics.parquet"
    table.write_bytes(table.read_bytes() + b" ")
    done = compare(a, b)
    assert done.exit_code == 5
    assert str(table) in done.stderr
    (a / "manifest.json").write_text("{}")
    assert compare(a, b).exit_code == 5


def test_an_experiments_folder_with_one_run_stands_for_it(tmp_path, folder):
    a = folder("experiment/0123456789ab")
    assert compare(a.parent, a).exit_code == 0
    folder("experiment/ba9876543210", 1.03)
    two = compare(a.parent, a)
    assert two.exit_code == 2
    assert "holds 2 runs, name one" in two.stderr
    (tmp_path / "empty").mkdir()
    assert "holds no run" in compare(tmp_path / "empty", a).stderr
    assert "none: no such folder of a run" in compare(tmp_path / "none", a).stderr


def test_an_unfinished_run_is_not_compared(folder):
    a, b = folder("a"), folder("b")
    (b / "batches").mkdir()
    (b / "DONE").unlink()
    done = compare(a, b)
    assert done.exit_code == 5
    assert "not finished" in done.stderr


def test_an_experiment_file_stands_for_its_results(tmp_path, folder):
    file = written(tmp_path, VALID)
    done = compare(folder("a"), file, "--out", tmp_path / "results")
    assert done.exit_code == 2
    assert f"make them with: nlbench run {file}" in done.stderr


def test_a_failed_filter_fails_the_gate(tmp_path, folder):
    gone = np.zeros(ERROR.shape, bool)
    gone[0] = True
    b = made.folder(tmp_path / "b", made.side(np.where(gone, np.nan, ERROR), 1, gone))
    done = compare(folder("a"), b)
    assert done.exit_code == 3
    assert "1 FAILED of 7 comparisons" in done.stdout


def test_labels_that_look_like_markdown_or_terminal_codes_stay_text(folder, tmp_path):
    """Labels, versions and the like may be a stranger's."""
    a, b = (
        folder("a"),
        made.folder(tmp_path / "b", made.side(1.05 * ERROR, 1), versions={"x": "[y](z)\x1b[2J"}),
    )
    done = compare(a, b, "--markdown")
    assert r"\[y\](z)\\x1b\[2J" in done.stdout
    assert "\x1b" not in done.stdout + compare(a, b).stdout


def test_a_run_of_filters_that_all_failed_equals_itself(tmp_path):
    side = made.side(ERROR, 1, lost=np.ones(ERROR.shape, bool))
    done = compare(made.folder(tmp_path / "a", side), made.folder(tmp_path / "b", side))
    assert (done.exit_code, done.stderr) == (0, "")
    assert "equal: the same run" in done.stdout


def test_options_that_exclude_each_other_are_refused(folder):
    a = folder("a")
    assert compare(a, a, "--all", "--statistic", "rms").exit_code == 2
    assert compare(a, a, "--json", "--markdown").exit_code == 2
