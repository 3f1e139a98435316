"""Claim: a failing experiment stops no other, and the gravest fault decides how the command ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from nlbench.errors import EnvironmentFault, GateError, Interrupted, LimitError, NlbenchError
from nlbench.reproduce import driver, jobs, reproduction
from nlbench.reproduce.driver import Outcome
from nlbench.reproduce.recorded import Compared, Row
from tests import small_source, synthetic_run

NOTHING = Compared(0, (), 0, 0)
CHOSEN = jobs.Chosen(((small_source.SOURCE, small_source.ENTRIES),), ())
CHANGED = (
    Row("full", "small-1970", "figure 1", "300", "DIFFERS"),
    Row("full", "small-1970", "figure 1", "300", "REPRODUCED"),
)


@pytest.fixture
def two(tmp_path):
    """Jobs of two experiments that have not been run."""
    return jobs.jobs(CHOSEN, small_source.write(tmp_path / "configs"), tmp_path / "out")


def run(jobs, tmp_path):
    seen = []
    return driver.run(jobs, tmp_path / "out", 2, seen.append), seen


def test_each_failure_is_told_with_its_exit_code_and_complaint(two, tmp_path):
    for job in two:
        job.file.unlink()
    outcomes, seen = run(two, tmp_path)
    assert {each.job.name for each in seen} == set(outcomes) == {"small-a", "small-b"}
    assert [each.code for each in outcomes.values()] == [2, 2]
    assert all("no such file" in each.fault for each in outcomes.values())


def test_a_quick_run_is_of_fewer_runs_and_draws_what_entries_show(tmp_path):
    configs = small_source.write(tmp_path / "configs", runs=5000)
    full, quick = (jobs.jobs(CHOSEN, configs, tmp_path / "out", quick) for quick in (False, True))
    assert [job.runs for job in full] == [5000, 5000]
    assert [job.runs for job in quick] == [2048, 2048]
    assert [job.settings for job in full] == [(), ()]
    assert [job.experiment.figures for job in quick] == [["rms", "trace"], ["rms"]]
    assert [job.folder for job in quick] == [job.folder for job in full]
    assert [job.experiment.engine.cost for job in quick] == [False, False]


def test_a_quick_run_with_a_dear_reference_is_of_fewer_runs_still():
    exact, without = (
        SimpleNamespace(name=name, experiments=(name,), pictures=())
        for name in ("schwartz/d1-m11", "schwartz/response-d1-m11")
    )
    chosen = jobs.Chosen(((None, (exact, without)),), ())
    quick = jobs.jobs(chosen, Path("configs"), Path("out"), quick=True)
    assert quick[0].experiment.reference == "exact"
    assert quick[1].experiment.reference is None
    assert [job.runs for job in quick] == [320, quick[1].experiment.monte_carlo.runs]


@pytest.mark.parametrize("finished", [True, False])
def test_results_count_and_not_how_the_process_died(two, tmp_path, monkeypatch, finished):
    monkeypatch.setattr(driver, "done", lambda job: finished)
    process = subprocess.Popen([sys.executable, "-c", "import os; os.abort()"])
    process.wait()
    ended = driver._outcome(driver._Running(two[0], process, (tmp_path / "said").open("w+b"), 0.0))
    assert ended.code == (0 if finished else -signal.SIGABRT)
    assert ended.fault.startswith("killed by signal 6 (SIGABRT)")
    assert ("after its results were written" in ended.fault) is finished


def test_settings_reach_the_run(tmp_path):
    configs = small_source.write(tmp_path / "configs", runs=70)
    job = jobs.jobs(CHOSEN, configs, tmp_path / "out", quick=True)[1]
    outcomes, _ = run([job], tmp_path)
    assert outcomes["small-b"].code == 0
    assert {path.name for path in (job.folder / "figures").iterdir()} == {"rms-x.svg", "rms-x.png"}
    assert driver.done(job)


def test_what_is_done_is_not_run_again(two, tmp_path, monkeypatch):
    monkeypatch.setattr(driver, "done", lambda job: job.name == "small-a")
    for job in two:
        job.file.unlink()
    outcomes, _ = run(two, tmp_path)
    assert (outcomes["small-a"].code, outcomes["small-a"].seconds) == (0, None)
    assert outcomes["small-b"].code == 2


def test_the_longest_begins_first(two, tmp_path, monkeypatch):
    monkeypatch.setattr(driver, "done", lambda job: True)
    longer = two[1]._replace(runs=10 * two[1].runs)
    _, seen = run([two[0], longer], tmp_path)
    assert [each.job.name for each in seen] == ["small-b", "small-a"]


def test_a_run_is_done_when_its_results_are_sound_read_alike_and_of_as_many_runs(tmp_path):
    results = synthetic_run.results(tmp_path / "run", runs=500)
    (results.path / "report.html").write_text("")
    saved = results.experiment
    uncosted = saved.model_copy(update={"engine": saved.engine.model_copy(update={"cost": False})})
    job = jobs.Job("tests/synthetic", tmp_path / "file.yaml", (), uncosted, 500, results.path)
    assert driver.done(job)
    assert not driver.done(job._replace(experiment=saved))
    assert not driver.done(job._replace(runs=501))
    other = uncosted.model_copy(update={"traces": [0]})
    assert not driver.done(job._replace(experiment=other))
    (results.path / "tables" / "paired.csv").write_text("edited")
    assert not driver.done(job)
    assert not driver.done(job._replace(folder=tmp_path / "nowhere"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_stop_reaches_every_process(two, tmp_path, monkeypatch, number):
    begun = []

    def start(job, out):
        process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"], process_group=0)
        begun.append(process)
        if len(begun) == 2:
            os.kill(os.getpid(), number)
        return driver._Running(job, process, (tmp_path / job.name).open("w+b"), 0.0)

    monkeypatch.setattr(driver, "_start", start)
    before = signal.getsignal(number)
    with pytest.raises(Interrupted, match="goes on"):
        run(two, tmp_path)
    assert [process.returncode for process in begun] == [-signal.SIGTERM] * 2
    assert signal.getsignal(number) is before


def outcome(code, two):
    return Outcome(two[0], code, "a complaint", 1.0)


def test_the_gravest_fault_comes_first(two):
    outcomes = {str(code): outcome(code, two) for code in (4, 0, 5, 1)}
    found = reproduction.faults(outcomes, NOTHING._replace(changed=(CHANGED,)))
    assert [type(each) for each in found] == [NlbenchError, EnvironmentFault, LimitError, GateError]
    assert "small-a (exit code 1): a complaint" in str(found[0])
    assert "figure 1: DIFFERS -> REPRODUCED" in str(found[-1])


def test_a_killed_process_is_the_environments_fault(two):
    (found,) = reproduction.faults({"x": outcome(-9, two)}, NOTHING)
    assert found.exit_code == 5
    assert reproduction.faults({"x": outcome(0, two)}, NOTHING) == []


def test_a_part_has_a_summary_of_its_own():
    wanted = reproduction.Wanted(None, None, False, Path("results"), Path("configs"))
    assert wanted.folder == Path("results/reproduction")
    assert wanted._replace(quick=True).folder == Path("results/reproduction-quick")
    part = wanted._replace(source="culver", figure="table 8.1", quick=True)
    assert part.folder == Path("results/reproduction-quick-culver-table-8.1")
    assert part.command == "nlbench reproduce culver --figure 'table 8.1' --quick"
    assert part.record == Path("results/reproduction/recorded.csv")
