"""Claims: a plan counts what there is to do, finds known costs of blocks, and says sizes that a real run then has."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest

import nlbench as nb
from nlbench import engine, report, schedule
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.planning import calibration, durations, machine, plan, sizes, space
from nlbench.engine.planning.compilation import LOADING, listening
from nlbench.engine.planning.memory import memory
from nlbench.engine.problem import make
from nlbench.errors import EnvironmentFault
from nlbench.statistics.totals import Totals
from tests.small_runs import experiment

RUNS = 3000


def small(runs=RUNS):
    """One filter, ten steps: what is slow is compiling, and the first picture."""
    return experiment(
        filters=["linearised-kalman"],
        reference=None,
        time={"end": 0.2, "step": 0.02, "output": 0.1},
        report_times=[0.2],
        figures=["rms"],
        monte_carlo={"runs": runs, "seed": 11},
    )


@pytest.fixture(scope="module")
def compiled():
    return compile_chunks(make(small()), 11)


@pytest.fixture(scope="module")
def planned_and_run(tmp_path_factory):
    """A plan, the run planned, and the plans of the same and of a longer run afterwards."""
    out = tmp_path_factory.mktemp("planned")
    before = engine.plan(small(), out)
    results = nb.run(small(), out)
    report.write(results)
    return before, results, engine.plan(small(), out), engine.plan(small(10 * RUNS), out)


class Sleeping:
    """Blocks that take a known time; the sums are real, of the first block."""

    def __init__(self, compiled, seconds):
        self.problem, self.executables = compiled.problem, compiled.executables
        self.seconds, self.computed = seconds, []
        self._sums = compiled.sums(0, 1, compiled.problem.block)

    def sums(self, first, count, runs, device):
        time.sleep(count * self.seconds)
        self.computed += range(first, first + count)
        return {name: np.repeat(value, count, axis=0) for name, value in self._sums.items()}


@pytest.mark.parametrize(("seconds", "threads"), [(0.004, 1), (0.02, 2)])
def test_the_cost_of_a_block_is_found(compiled, seconds, threads):
    found = calibration.calibrate(Sleeping(compiled, seconds), threads)
    # Threads that sleep take no time from each other, so the sums add to it only where there is one.
    assert seconds / threads <= found.seconds_per_block < 1.5 * seconds / threads + 0.002
    assert found.share < 0.8


def test_dear_blocks_are_computed_once_on_each_thread(compiled):
    dear = Sleeping(compiled, 0.9)
    found = calibration.calibrate(dear, 2)
    assert sorted(dear.computed) == [0, 1]
    assert found.seconds_per_block == pytest.approx(0.45, rel=0.3)


def test_cheap_blocks_are_computed_for_a_second_or_two(compiled):
    begun = time.perf_counter()
    found = calibration.calibrate(Sleeping(compiled, 0.001), 2)
    assert time.perf_counter() - begun < 8
    assert found.totals.blocks > 100


def test_filters_times_runs_times_steps_are_counted(planned_and_run):
    plan = planned_and_run[0]
    assert (plan["runs"], plan["runs_done"]) == (RUNS, 0)
    assert plan["blocks"] == plan["blocks_left"] == 47  # of 64 runs
    assert plan["steps_per_run"] == 10
    assert plan["filter_steps"] == 1 * 3000 * 10


@pytest.mark.parametrize("what", ["seconds", "memory_bytes", "disk_bytes"])
def test_parts_are_not_negative_and_add_up(planned_and_run, what):
    *parts, total = planned_and_run[0][what].values()
    assert min(parts) >= 0
    assert sum(parts) == pytest.approx(total)


def test_what_is_finished_costs_no_computing(planned_and_run):
    again = planned_and_run[2]
    assert (again["runs_done"], again["blocks_left"]) == (RUNS, 0)
    assert set(again["seconds"]) == {"start", "figures_and_report", "total"}


def test_a_longer_run_costs_what_is_missing(planned_and_run):
    longer = planned_and_run[3]
    whole = RUNS // 64  # the last, partial block is not in the checkpoint
    assert longer["runs_done"] == 64 * whole
    assert longer["blocks_left"] == -(-10 * RUNS // 64) - whole


def test_each_filter_is_timed_by_its_share_of_the_operations():
    """100 steps, 20 updates of (10, 5) and of (30, 25): 1,100 operations against 3,500, and one more for each."""
    steps = schedule.make(1.0, 0.01, 0.5, 0.05)
    found = durations.shares(SimpleNamespace(schedule=steps), [(10, 5), (30, 25)])
    assert found == pytest.approx((1101 / 4602, 3501 / 4602))


def test_a_dear_filter_costs_its_first_rounds_and_a_cheap_one_all_of_them():
    """A block of a second: warmed up and timed once, then as often as two seconds allow, each time after a call that is
    not timed. One of 2 ms: seven rounds of 16 blocks."""
    problem = SimpleNamespace(schedule=schedule.make(1.0, 0.01, 0.5, 0.05), block=64)
    assert durations._timing(problem, 1.0) == pytest.approx(1.0 * (2 + 2 * 2))
    assert durations._timing(problem, 0.002) == pytest.approx(0.002 * (2 + 7 * 17))


def size(path, names):
    return sum(file.stat().st_size for name in names for file in path.glob(name))


def test_the_disk_planned_is_that_of_the_run(planned_and_run):
    plan, results, *_ = planned_and_run
    disk, path = plan["disk_bytes"], results.path
    # The totals lack the last, partial block; the file has its names and checksum besides.
    assert size(path, ["batches/*.npz"]) == pytest.approx(disk["checkpoint"], rel=0.05)
    assert size(path, ["tables/runs.parquet"]) == pytest.approx(disk["kept_runs"], rel=0.15)
    others = size(path, ["tables/*"]) - size(path, ["tables/runs.*", "tables/cost.*"])
    assert others == pytest.approx(disk["tables"], rel=0.15)
    assert size(path, ["figures/*", "report.html"]) == pytest.approx(disk["figures_and_report"], rel=0.5)


def test_the_pictures_planned_are_those_drawn(planned_and_run):
    results = planned_and_run[1]
    layout = make(small()).layout
    assert sizes.pictures(small(), layout, diverged=False) == len(list(results.path.glob("figures/*.svg")))


@pytest.mark.parametrize(("diverged", "count"), [(False, 6), (True, 8)])
def test_by_default_a_scalar_has_six_pictures_and_two_more_where_runs_diverge(diverged, count):
    """RMS, mean error, variance, third moment, NEES, cost; clipped RMS and divergence."""
    every = small().model_copy(update={"figures": None})
    assert sizes.pictures(every, make(small()).layout, diverged) == count


def test_the_size_of_the_totals_is_foretold_from_fewer_runs(compiled):
    few, many = Totals(compiled.problem.layout), Totals(compiled.problem.layout)
    few.add(0, compiled.sums(0, 2, 128))
    many.add(0, compiled.sums(0, 60, 60 * 64))
    actual = sum(array.nbytes for array in many.state().values())
    assert sizes.state(few, 60 * 64) == actual
    assert actual <= sizes.most_state(Totals(compiled.problem.layout), compiled, 60 * 64) < 1.5 * actual


def test_tables_are_timed_on_no_more_runs_than_there_will_be(compiled):
    many = Totals(compiled.problem.layout)
    many.add(0, compiled.sums(0, 60, 60 * 64))
    assert plan._at_most(60 * 64, compiled, many, 2) is many
    assert plan._at_most(100, compiled, many, 2).runs == 128


def test_a_billion_runs_need_no_more_memory_than_those_that_are_kept(compiled):
    totals = Totals(compiled.problem.layout)
    assert sizes.most_state(totals, compiled, 10**9) == sizes.most_state(totals, compiled, 20_000)


def test_the_memory_of_calls_is_that_of_the_arrays_they_return(compiled):
    arrays = sum(array.nbytes for array in compiled.sums(0, 64, 64 * 64).values())
    program = sizes.program(compiled)
    assert arrays <= program["output"] < 1.1 * arrays
    needs = memory(compiled, compiled.problem, 0, 0, threads=2, process=0)
    assert needs["calls"] >= 2 * (program["temp"] + 3 * program["output"])


@pytest.mark.parametrize(("what", "said"), [("free_memory", "memory: needs"), ("free_disk", "disk of")])
def test_what_does_not_fit_is_refused(compiled, tmp_path, monkeypatch, what, said):
    monkeypatch.setattr(space.atomic if what == "free_disk" else space.machine, what, lambda *where: 1000)
    with pytest.raises(EnvironmentFault, match=f"not begun, .*{said}.*free 0.001 MB.*--yes"):
        space.require(compiled, Totals(compiled.problem.layout), 1, 2, tmp_path)


def test_a_refused_run_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(space.atomic, "free_disk", lambda folder: 1000)
    with pytest.raises(EnvironmentFault):
        nb.run(small(), tmp_path, check=space.require)
    assert not [path for path in tmp_path.rglob("*") if path.is_file() and path.name != ".lock"]


def test_memory_of_a_control_group_is_what_its_limits_leave(tmp_path, monkeypatch):
    """Of the innermost group with a limit and of those around it; files kept in memory are given up when needed."""
    inside = tmp_path / "slurm" / "job" / "step"
    for path, limit, used, files in (
        (inside, "max", 5, 0),
        (inside.parent, "1000", 900, 500),
        (inside.parents[1], "5000", 100, 0),
    ):
        path.mkdir(parents=True, exist_ok=True)
        (path / "memory.max").write_text(f"{limit}\n")
        (path / "memory.current").write_text(f"{used}\n")
        (path / "memory.stat").write_text(f"anon 1\ninactive_file {files}\n")
    (tmp_path / "groups").write_text("0::/slurm/job/step\n")
    monkeypatch.setattr(machine, "CGROUP", tmp_path)
    monkeypatch.setattr(machine, "GROUPS", tmp_path / "groups")
    assert machine.free_memory() == 600
    (inside.parent / "memory.max").write_text("max\n")
    assert machine.free_memory() == 4900


def test_what_fits_is_not_refused(compiled, tmp_path):
    space.require(compiled, Totals(compiled.problem.layout), 10**9, 2, tmp_path)


@pytest.mark.long
def test_a_program_from_the_cache_is_known_by_the_time_it_once_took(tmp_path, monkeypatch):
    monkeypatch.setenv("NLBENCH_CACHE", str(tmp_path))
    problem, found = make(small()), []
    for _ in range(2):
        with listening() as heard:
            begun = time.perf_counter()
            compile_chunks(problem, 11)
            found.append(heard.compilation(time.perf_counter() - begun))
    cold, warm = found
    assert cold.load == LOADING * cold.compile
    assert warm.compile == pytest.approx(cold.compile, rel=0.5)
    assert warm.load < cold.compile / 2
