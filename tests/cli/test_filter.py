"""Claim: `nlbench filter` runs an experiment's filters on a user's own data, and says what is wrong with the data."""

from __future__ import annotations

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats
from typer.testing import CliRunner

import nlbench as nb
from nlbench.cli.app import app
from tests.example import spoiled, written

STEPS = """\
# How large is the coefficient?
experiment: mine
system: {name: parameter-identification}
filters:
  - ekf
  - {name: ekf, label: another start, initial: {mean: [0.4, 0.6], variance: [2.0, 0.04]}}
  - {name: ekf, label: another noise, model: {measurement_variance: 3.0}}
"""
SCALAR = """\
experiment: mine
system: {name: culver-scalar, interval: 0.1}
filters: [ekf]
"""
Y = np.array([0.3, -0.2, np.nan, 1.4, 2.2, 0.1])
K = np.array([1, 2, 3, 4, 7, 9])


def invoke(*arguments):
    return CliRunner().invoke(app, ["filter", *map(str, arguments)])


def recorded(folder, times=K, y=Y, name="data.csv"):
    rows = [f"{t},{'' if np.isnan(value) else value}" for t, value in zip(times, y, strict=True)]
    return written(folder, "\n".join(["time,seen", *rows]), name)


def estimates(done):
    assert done.exit_code == 0, done.stderr
    return pd.read_csv(io.StringIO(done.stdout))


def ekf_by_hand(mean, cov, noise):
    """Rows (mean, variances, innovation, nis, log-likelihood) of x1+ = x1 x2 + w, x2+ = x2, y = x1 + v in NumPy."""
    m, P, at, rows = np.array(mean), np.diag(cov), 0, []
    for k, y in zip(K, Y, strict=True):
        for _ in range(k - at):
            A = np.array([[m[1], m[0]], [0, 1]])
            m, P = np.array([m[0] * m[1], m[1]]), A @ P @ A.T + np.diag([1.0, 0.0])
        z, s, at = y - m[0], P[0, 0] + noise, k
        if np.isnan(y):
            rows.append([*m, *np.diag(P), np.nan, np.nan, 0.0])
            continue
        m, P = m + P[:, 0] * z / s, P - np.outer(P[:, 0], P[:, 0]) / s
        rows.append([*m, *np.diag(P), z, z * z / s, -0.5 * (z * z / s + np.log(2 * np.pi * s))])
    return np.array(rows)


BY_HAND = {
    "ekf": ekf_by_hand([0.0, 0.5], [4 / 3, 0.23**2], 1.0),
    "another start": ekf_by_hand([0.4, 0.6], [2.0, 0.04], 1.0),
    "another noise": ekf_by_hand([0.0, 0.5], [4 / 3, 0.23**2], 3.0),
}


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steps")
    return invoke(written(folder, STEPS), recorded(folder))


def test_every_filter_of_the_file_is_the_one_by_hand(printed):
    """Steps of which none, one or several pass unmeasured; a start and a model that only one filter believes in."""
    table = estimates(printed)
    assert list(table["filter"].unique()) == list(BY_HAND)
    for label, rows in BY_HAND.items():
        mine = table[table["filter"] == label].drop(columns="filter")
        np.testing.assert_array_equal(mine["time"], K)
        columns = [*mine.filter(like="_mean"), *mine.filter(like="_variance"), "seen_innovation", "nis"]
        np.testing.assert_allclose(mine[[*columns, "log_likelihood"]], rows, rtol=1e-10, atol=1e-14)


def test_the_summary_has_stderr_to_itself_and_judges_by_chi_square(printed):
    said = printed.stderr
    assert "6 rows; measurements missing: 1" in said
    for label, rows in BY_HAND.items():
        (line,) = [line for line in said.splitlines() if line.strip().startswith(f"{label} ")]
        low, high = stats.chi2.ppf([0.025, 0.975], 5) / 5
        nis = np.nanmean(rows[:, 5])
        verdict = "consistent" if low <= nis <= high else "overconfident" if nis > high else "too cautious"
        wanted = [f"{rows[:, 6].sum():.2f}", f"{nis:.3f}", "1.000", f"{low:.3f}", "..", f"{high:.3f}"]
        assert line.split(maxsplit=len(label.split()))[-1].split(maxsplit=6) == [*wanted, verdict]
    assert "next: nlbench filter" in said
    assert max(map(len, said.splitlines()[2:6])) <= 80


def test_a_file_and_json_say_what_is_printed(tmp_path, printed):
    config, data, out = written(tmp_path, STEPS), recorded(tmp_path), tmp_path / "new" / "out.csv"
    done = invoke(config, data, "--out", out, "--json", "--filter", "another start", "--filter", "ekf")
    assert (done.exit_code, done.stderr) == (0, "")
    kept = estimates(printed).query("filter != 'another noise'")
    pd.testing.assert_frame_equal(pd.read_csv(out), kept)
    facts = json.loads(done.stdout)
    assert [each["filter"] for each in facts["filters"]] == ["ekf", "another start"]
    assert facts["filters"][0]["verdict"] in printed.stderr
    assert (facts["rows"], facts["missing"], facts["filters"][0]["samples"]) == (6, 1, 5)
    np.testing.assert_allclose(facts["filters"][0]["log_likelihood"], BY_HAND["ekf"][:, 6].sum())
    whole = json.loads(invoke(config, data, "--json", "--filter", "ekf").stdout)
    assert [row["time"] for row in whole["estimates"]] == K.tolist()
    assert whole["estimates"][2]["nis"] is None


def test_large_times_and_another_start_change_nothing_and_lose_no_digit(tmp_path):
    config, start = written(tmp_path, SCALAR), 1_700_000_000
    times = np.array([0.125, 0.25, 0.25, 0.5, 1.0, 1.0625])
    near = estimates(invoke(config, recorded(tmp_path, times, Y)))
    far = estimates(invoke(config, recorded(tmp_path, times + start, Y), "--start", start))
    np.testing.assert_array_equal(far["time"], times + start)
    same = near.drop(columns=["filter", "time"])
    np.testing.assert_allclose(far[same.columns], same, rtol=1e-12)


def test_the_experiments_step_is_the_filters_step(tmp_path):
    system = nb.systems.build("culver-scalar", interval=0.1)
    for step in (0.05, 0.025):
        f = nb.filters.build("ekf", system, step=step)
        wanted = nb.filter_data(f, [0.1, 0.3], [1.0, 2.0])
        config = written(tmp_path, f"{SCALAR}time: {{step: {step}}}\n")
        found = estimates(invoke(config, recorded(tmp_path, [0.1, 0.3], [1.0, 2.0])))
        np.testing.assert_allclose(found["x_mean"], wanted["x_mean"], rtol=1e-13)


def test_the_seed_and_nothing_else_changes_what_a_sampling_filter_says(tmp_path):
    config = written(tmp_path, STEPS.replace("filters:", "filters:\n  - {name: bootstrap, particles: 50}"))
    runs = [
        invoke(config, recorded(tmp_path), "--filter", "bootstrap", "--seed", seed).stdout
        for seed in (1, 1, 2)
    ]
    assert runs[0] == runs[1] != runs[2]


def test_measured_columns_may_be_named_in_the_systems_order(tmp_path):
    text = "note,t,wanted\n7,1,0.3\n7,2,-0.2\n"
    done = invoke(
        written(tmp_path, STEPS), written(tmp_path, text, "data.csv"), "--time", "t", "--measured", "wanted",
        "--filter", "ekf",
    )  # fmt: skip
    innovations = estimates(done)["wanted_innovation"]
    np.testing.assert_allclose(innovations, BY_HAND["ekf"][:2, 4])
    assert "--filter ekf --time t --measured wanted --out data-filtered.csv" in done.stderr


def test_limited_updates_are_no_samples_and_leave_no_bounds(tmp_path):
    config = written(tmp_path, SCALAR.replace("[ekf]", "[{name: ekf, limiter: 1, missing: false}, ekf]"))
    config.write_text(config.read_text().replace("name: ekf,", "name: ekf, label: limited,"))
    done = invoke(config, recorded(tmp_path, [0.1, 0.2, 0.3], [30.0, 1.5, np.nan]), "--json")
    limited, plain = json.loads(done.stdout)["filters"]
    assert (limited["altered"], limited["samples"], limited["verdict"]) == (1, 1, "not judged")
    assert limited["low"] is None
    assert (plain["altered"], plain["samples"], plain["verdict"]) == (0, 2, "overconfident")


def test_a_filter_that_is_lost_fails_with_four_and_its_first_line(tmp_path):
    config = written(tmp_path, SCALAR.replace("[ekf]", "[ekf, second-order]"))
    done = invoke(config, recorded(tmp_path, [0.1, 0.2, 3.0, 3.1], [1.0, 1e5, 1.0, 1.0]), "--json")
    assert done.exit_code == 4
    assert all(each["verdict"] == "FAILED" for each in json.loads(done.stdout)["filters"])
    said = f"FAILED: ekf: no finite estimate from {tmp_path}/data.csv:4 on; first in the propagation: "
    assert f"{said}the mean and covariance are not finite" in done.stderr


def test_everything_wrong_with_both_files_is_said_at_once_and_nothing_is_written(tmp_path):
    config = written(tmp_path, spoiled("limiter", "limter"))
    data = written(tmp_path, "time,y\n0,1\n" + "1,1\n" * 14 + "2,x\n1,1\n", "data.csv")
    done = invoke(config, data, "--out", tmp_path / "out.csv")
    assert done.exit_code == 2
    assert done.stdout == ""
    said = done.stderr.replace(f"{tmp_path}/", "").splitlines()
    assert "fig.yaml:6:25: filters.1.limter: unknown key; did you mean 'limiter'?" in said
    assert "data.csv:17: y: expected a finite number, found 'x'" in said
    assert "data.csv:18: time: 1 comes after 2 of line 17; times must not descend" in said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.csv", "fig.yaml"]


def test_a_start_that_does_not_fit_hides_no_option_that_does_not(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    filters = "[{name: ukf, kappa: -30, initial: {mean: [1, 2]}}]"
    written(tmp_path, f"experiment: mine\nsystem: culver-scalar\nfilters: {filters}\n")
    done = invoke("fig.yaml", written(tmp_path, "time,a\n1,1\n", "data.csv").name)
    assert done.exit_code == 2
    assert "filters.0.initial.mean: got shape (2,), the system needs (1,)" in done.stderr
    assert "ukf.kappa: -30.0 must be above -1" in done.stderr


@pytest.mark.parametrize(
    ("config", "text", "options", "says"),
    [
        (STEPS, "time,a,b\n1,2,3\n", [], "data.csv:1: 2 measured columns (a, b), but the system of 'ekf' measures 1"),
        (STEPS, "time,a\n0.5,1\n", [], "data.csv:2: time: expected a step number"),
        (STEPS, "time,a\n1,1\n", ["--start", "0.5"], "--start: expected a step number"),
        (SCALAR, "time,a\n1,1\n", ["--start", "nan"], "--start: expected a finite number"),
        (SCALAR, "time,a\n1,1\n", ["--start", "2"], "data.csv:2: time: 1.0 comes before the start, 2.0"),
        (SCALAR, "time,a\n1e12,1\n", [], "data.csv: 1e+14 steps of 0.01"),
        (SCALAR, "time,a\n1.7e9,1\n", [], "1,000,000,000; --start 1700000000 starts at the first row; a longer --set"),
        (SCALAR, "time,a\n1.7e12,1\n1700000000100,1\n", [], "are times in milliseconds? Then divide them by 1000; --"),
        (STEPS, "time,a\n1700000000,1\n", [], "steps of 1 from the start, 0, to the last row, more than 1,000,000,000"),
        (SCALAR, "time,a\n1,1\n", ["--filter", "efk"], "--filter: no filter is labelled 'efk'; did you mean 'ekf'?"),
        (SCALAR, "time,a\n1,1\n", ["--out", "."], "--out: . is a folder"),
        (SCALAR, "time,a\n1,1\n", ["--out", "data.csv"], "--out: would overwrite data.csv, which is read"),
        (SCALAR, "time,a\n1,1\n", ["--seed", "x"], "--seed: monte_carlo.seed: expected a whole number"),
        (
            "experiment: mine\nsystem: schwartz\nfilters: [kushner-2]\n", "time,a\n1,1\n", [],
            "the system is measured continuously",
        ),
        (
            "experiment: mine\nsystem: lunar-orbit\nfilters: [ekf]\n", "time,a\n1,1\n", [],
            "ekf: the system is measured at angles",
        ),
    ],
)  # fmt: skip
def test_what_does_not_fit_ends_with_two_in_plain_words(tmp_path, monkeypatch, config, text, options, says):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, config)
    done = invoke("fig.yaml", written(tmp_path, text, "data.csv").name, *options)
    assert done.exit_code == 2, done.stderr
    assert says in done.stderr
    assert done.stdout == ""
    assert (tmp_path / "data.csv").read_text() == text
    assert len(list(tmp_path.iterdir())) == 2


def test_a_full_disk_leaves_no_part_of_a_file(tmp_path, monkeypatch):
    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("nlbench.results.atomic.os.fsync", full)
    done = invoke(
        written(tmp_path, STEPS), recorded(tmp_path), "--filter", "ekf", "--out", tmp_path / "out.csv"
    )
    assert done.exit_code == 5
    assert "No space left" in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.csv", "fig.yaml"]


@pytest.mark.parametrize(
    ("times", "says"),
    [
        (
            [170.0, 170.1],
            "predicted from 0 over 17,000 steps of 0.01 before the first row, at 170; --start 170 starts",
        ),
        (
            [100.0, 200.0],
            "rows are 100 apart and the system is measured every 0.1: are times in milliseconds?",
        ),
    ],
)
def test_a_log_that_starts_late_or_is_in_milliseconds_is_said_on_stderr_and_in_json(tmp_path, times, says):
    config, data = written(tmp_path, SCALAR), recorded(tmp_path, times, [1.0, 1.1])
    done = invoke(config, data)
    (line,) = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    assert line.startswith(f"warning: {data}: {says}")
    assert len(estimates(done)) == 2
    quiet = invoke(config, data, "--json")
    assert quiet.stderr == ""
    assert json.loads(quiet.stdout)["warning"].startswith(f"{data}: {says}")
    if "--start" in says:
        begun = invoke(config, data, "--json", "--start", "170")
        assert json.loads(begun.stdout)["warning"] is None


def test_every_option_that_cannot_be_meant_is_said_at_once(tmp_path):
    config, data = written(tmp_path, SCALAR), recorded(tmp_path, [1.0], [1.0])
    done = invoke(config, data, "--out", tmp_path, "--start", "2", "--filter", "efk")
    assert done.exit_code == 2
    for says in ("--out: ", "comes before the start, 2.0", "no filter is labelled 'efk'"):
        assert says in done.stderr


def test_the_exact_reference_runs_along_and_believes_in_what_makes_the_data(tmp_path):
    config = written(tmp_path, f"{SCALAR}reference: exact\ntruth: {{measurement_variance: 0.4}}\n")
    table = estimates(invoke(config, recorded(tmp_path, [0.1, 0.2], [1.9, 1.8])))
    known = nb.systems.build("culver-scalar", interval=0.1, measurement_variance=0.4)
    wanted = nb.filter_data(nb.filters.build("exact", known), [0.1, 0.2], [1.9, 1.8])
    np.testing.assert_allclose(table[table["filter"] == "exact"]["x_mean"], wanted["x_mean"], rtol=1e-12)
