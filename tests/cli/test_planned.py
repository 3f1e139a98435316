"""Claims: `plan` speaks in units of people; precision and budget are refused in plain words; nothing waits for an
answer."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from nlbench import engine
from nlbench.cli import budget
from nlbench.cli.app import app
from nlbench.errors import ConfigError
from tests.example import VALID, spoiled, written

CHEAP = """\
experiment: cheap
system: {name: culver-scalar}
filters: [linearised-kalman]
time: {end: 0.2, step: 0.02, output: 0.1}
"""
COST = {
    "filters": ["a", "b"],
    "runs": 20_000,
    "runs_done": 640,
    "steps_per_run": 100,
    "filter_steps": 4_000_000,
    "measurements_per_run": 20,
    "threads": 2,
    "precision": {
        "asked": "rms:1%",
        "runs": 20_000,
        "pilot": 4096,
        "share": 0.045,
        "filter": "b",
        "time": 2.0,
        "coordinate": "x",
        "left_out": ("a",),
    },
    "seconds": {"run": 90.0, "total": 90.0},
    "memory_bytes": {"calls": 3 * 2**20, "total": 3 * 2**20},
    "memory_free_bytes": 2**30,
    "disk_bytes": {"checkpoint": 5 * 2**30, "total": 5 * 2**30},
    "disk_free_bytes": 2**30,
}


def invoke(*arguments):
    return CliRunner().invoke(app, [str(word) for word in arguments])


def test_plan_says_what_a_run_needs_in_units_of_people(tmp_path, monkeypatch):
    monkeypatch.setattr(engine, "plan", lambda experiment, out, precision: COST)
    file = written(tmp_path, VALID)
    text = invoke("plan", file, "--precision", "rms:1%", "--out", "elsewhere").stdout
    for words in ("1.5 min", "3.0 MiB", "2 x 20,000 x 100 = 4,000,000", "a, b", "640 runs", "--precision rms:1%",
                  "--out elsewhere", "needs 20,000 runs", "4.5 % at worst", "without a usable value: a"):  # fmt: skip
        assert words in " ".join(text.split())
    assert max(map(len, text.splitlines()[:-2])) <= 80
    assert text.count("MORE THAN IS FREE") == 1  # the disk, not the memory
    assert json.loads(invoke("plan", file, "--json").stdout) == json.loads(json.dumps(COST))


@pytest.mark.parametrize("command", ["plan", "run"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            ["--precision", "rms:1%", "--runs", "10"],
            "--precision chooses the number of runs, --runs gives it",
        ),
        (["--precision", "rsm:1%"], "--precision: no precision can be asked of 'rsm'; did you mean 'rms'?"),
        (["--precision", "rms:1"], "expected a percentage from 0.001% to 50%"),
    ],
)
def test_a_precision_that_cannot_be_had_ends_with_two(tmp_path, command, options, said):
    done = invoke(command, written(tmp_path, VALID), *options)
    assert done.exit_code == 2
    assert said in done.stderr


@pytest.mark.parametrize(("text", "expected"), [("90s", 90), ("1.5h", 5400), ("3d", 259_200), ("10min", 600)])
def test_a_budget_is_a_time_with_its_unit(text, expected):
    assert budget.seconds(text) == expected


def test_the_environment_gives_the_budget_where_no_option_does(monkeypatch):
    monkeypatch.setenv("NLBENCH_BUDGET", "2h")
    assert (budget.seconds(None), budget.seconds("1h")) == (7200, 3600)
    monkeypatch.delenv("NLBENCH_BUDGET")
    assert budget.seconds(None) == 12 * 3600


@pytest.mark.parametrize("text", ["", "2", "h", "-1h", "0h", "2 weeks", "nan h"])
def test_another_budget_is_refused(text):
    with pytest.raises(ConfigError, match="--budget: expected a time such as"):
        budget.seconds(text)


class Clock:
    """Time that passes when told to."""

    now = 0.0

    def monotonic(self):
        return self.now


def guarded(monkeypatch, limit, reports):
    """Report (second, runs done) of a million runs to a guard."""
    clock, shown = Clock(), []
    monkeypatch.setattr(budget, "time", clock)
    guard = budget.Guard(limit, lambda done, total: shown.append(done))
    for clock.now, done in reports:
        guard(done, 1_000_000)
    return shown


def test_a_run_within_its_budget_goes_on(monkeypatch):
    # 1,000 runs a second, 10,000 of them from a checkpoint: 980 s are left after 10 s.
    reports = [(0.0, 10_000), (1.0, 11_000), (10.0, 20_000)]
    assert guarded(monkeypatch, 990.0, reports) == [10_000, 11_000, 20_000]


def test_a_run_beyond_its_budget_is_stopped_after_some_seconds(monkeypatch):
    with pytest.raises(ConfigError, match=r"1,000,000 would take about 16.3 min more.*--yes"):
        guarded(monkeypatch, 970.0, [(0.0, 10_000), (1.0, 11_000), (10.0, 20_000)])


def test_time_in_which_workers_start_is_not_taken_for_slowness(monkeypatch):
    # The first block after a minute of compiling elsewhere; then 1,000 runs a second.
    reports = [(0.0, 0), (60.0, 64), (61.0, 1_064), (64.0, 4_064)]
    assert len(guarded(monkeypatch, 1000.0, reports)) == 4
    with pytest.raises(ConfigError, match="would take about"):
        guarded(monkeypatch, 990.0, reports)


def test_a_run_that_becomes_slow_later_is_not_stopped(monkeypatch):
    assert len(guarded(monkeypatch, 1000.0, [(0.0, 0), (1.0, 2_000), (5.0, 10_000), (500.0, 11_000)])) == 4


def test_a_billion_runs_are_refused_without_a_question(tmp_path, monkeypatch):
    monkeypatch.setattr(budget, "SETTLED", 0.1)
    file = written(tmp_path, CHEAP)
    done = CliRunner().invoke(
        app, ["run", str(file), "--runs", "1e12", "--out", str(tmp_path / "out")], input=""
    )
    assert done.exit_code == 2
    assert "1,000,000,000,000 would take about" in done.stderr
    assert "budget is 12.0 h" in done.stderr
    assert not list(tmp_path.rglob("DONE"))


def test_yes_lets_any_run_begin(tmp_path, monkeypatch):
    seen = {}

    def run(experiment, out, progress, check, dask):
        seen.update(progress=progress, check=check)
        raise KeyboardInterrupt

    monkeypatch.setattr(engine, "run", run)
    file = written(tmp_path, spoiled("runs: 20_000", "runs: 1e12"))
    invoke("run", file, "--yes", "--json")
    assert seen == {"progress": None, "check": None}
    invoke("run", file, "--json")
    assert isinstance(seen["progress"], budget.Guard)
    assert seen["check"] is not None
