"""Claims: workers of a cluster give the bytes of one machine, also when some are lost; those that could give others are
refused; without workers or without dask the user is told so."""

from __future__ import annotations

import os
import signal
import time
import warnings
from concurrent.futures import CancelledError
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

import nlbench as nb
from nlbench import runtime
from nlbench.cli.app import app
from nlbench.engine import cluster, remote
from nlbench.engine.compiled import compile_chunks
from nlbench.engine.problem import make
from nlbench.engine.resume import numerics
from nlbench.errors import ConfigError, EnvironmentFault, Interrupted
from tests.small_runs import experiment, table_bytes

SMALL = {"runs": 20_010, "seed": 11, "keep_runs": 3000}


def small(**changes):
    return experiment(monte_carlo=SMALL, **changes)


class Told:
    """A future of a scheduler that only fails as it was told to."""

    def __init__(self, error):
        self.error = error

    def add_done_callback(self, call):
        if self.error is not None:
            call(self)

    def result(self):
        raise self.error


class Scheduler:
    """A client of a scheduler without workers, whose tasks fail one after another as told."""

    def __init__(self, *errors):
        self.errors = list(errors)
        self.sent = 0

    def nthreads(self):
        return {}

    def submit(self, *call, pure):
        self.sent += 1
        return Told(self.errors.pop(0) if self.errors else None)

    def cancel(self, futures, force):
        pass


@pytest.fixture(autouse=True)
def options():
    """Those of XLA with which workers start, before jax does."""
    runtime.configure()


@pytest.fixture
def task():
    return remote.Task(small().resolved_yaml(), 100, ())


@pytest.fixture
def workers(task):
    made = []

    def make_one(*errors):
        made.append(cluster.Dask(Scheduler(*errors), task))
        return made[-1]

    yield make_one
    for each in made:
        each.close()


def test_a_worker_gives_the_sums_of_the_run():
    compiled = compile_chunks(make(small()), SMALL["seed"])
    task = remote.Task(small().resolved_yaml(), SMALL["runs"], tuple(numerics(compiled).items()))
    mine, theirs = compiled.sums(5, 2, SMALL["runs"]), remote.compute(task, 5, 2).sums
    assert {name: part.tobytes() for name, part in mine.items()} == {
        name: part.tobytes() for name, part in theirs.items()
    }


def test_a_worker_with_other_software_refuses():
    facts = numerics(compile_chunks(make(small()), SMALL["seed"])) | {"jaxlib": "0.0.1"}
    task = remote.Task(small().resolved_yaml(), 100, tuple(facts.items()))
    with pytest.raises(EnvironmentFault, match=r"jaxlib: \S+ there, 0\.0\.1 here"):
        remote.compute(task, 0, 1)


def test_xla_gets_as_many_threads_as_the_worker_has(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "get_worker", lambda: SimpleNamespace(state=SimpleNamespace(nthreads=3)))
    monkeypatch.setenv("PJRT_NPROC", "0")  # put back afterwards
    monkeypatch.delenv("PJRT_NPROC")
    remote.settle()
    assert os.environ["PJRT_NPROC"] == "3"


@pytest.mark.parametrize(
    "address", ["local", "local:0", "local:x", "somewhere", "tcp://host", "http://host:8787"]
)
def test_an_address_that_is_none_is_a_mistake_of_usage(address):
    done = CliRunner().invoke(app, ["run", "configs/quickstart.yaml", "--dask", address])
    assert done.exit_code == 2
    assert f"got '{address}'; expected" in done.output


def test_without_dask_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(cluster.importlib.util, "find_spec", lambda name: None)
    done = CliRunner().invoke(app, ["run", "configs/quickstart.yaml", "--dask", "local:2"])
    assert done.exit_code == 2
    assert done.output.strip() == cluster.INSTALL


def test_a_system_that_is_an_object_cannot_be_sent(tmp_path):
    own = nb.systems.build("culver-scalar")
    stated = {"experiment": "own", "system": own, "filters": ["third-order"]}
    with pytest.raises(ConfigError, match="cannot be sent"):
        nb.run({**stated, "time": {"end": 0.2, "step": 0.1}}, tmp_path, dask="local:2")


def test_without_workers_the_run_waits_and_then_gives_up(workers, monkeypatch, caplog):
    monkeypatch.setattr(cluster, "SECONDS_WITHOUT_WORKERS", 0.2)
    monkeypatch.setattr(cluster, "SECONDS_BETWEEN_LOOKS", 0.05)
    waiting = workers().submit(0, 1)
    with pytest.raises(EnvironmentFault, match=r"no dask worker .* goes on"):
        waiting.result(20)
    assert "no dask worker; waiting" in caplog.text


def test_a_scheduler_that_is_gone_ends_the_run(workers):
    pytest.importorskip("distributed")
    with pytest.raises(EnvironmentFault, match="scheduler is gone"):
        workers(CancelledError()).submit(0, 1).result(20)


def test_blocks_that_killed_workers_are_sent_again_but_not_for_ever(workers):
    killed = pytest.importorskip("distributed.scheduler").KilledWorker
    lost = [killed("task", SimpleNamespace(address="tcp://worker:1"), 3)] * 10
    sender = workers(*lost)
    with pytest.raises(EnvironmentFault, match="kill each worker"):
        sender.submit(0, 1).result(20)
    assert sender._client.sent == 1 + cluster.MOST_DEATHS


@pytest.mark.parametrize("error", [MemoryError("no room"), EnvironmentFault("other software")])
def test_an_error_of_a_worker_is_the_error_of_the_run(workers, error):
    pytest.importorskip("distributed")
    with pytest.raises(type(error), match=str(error)):
        workers(error).submit(0, 1).result(20)


@pytest.mark.parametrize(
    "error", [ModuleNotFoundError("No module named 'nlbench'"), ConfigError("no such key")]
)
def test_a_worker_with_another_environment_is_a_fault_of_it(workers, error):
    pytest.importorskip("distributed")
    with pytest.raises(
        EnvironmentFault, match=rf"a worker failed: {type(error).__name__}: {error}; workers need"
    ):
        workers(error).submit(0, 1).result(20)


def test_a_scheduler_that_needs_certificates_is_an_error_in_a_line():
    pytest.importorskip("distributed")
    with (
        cluster.opening("tls://127.0.0.1:9") as opened,
        pytest.raises(EnvironmentFault, match=r"no dask scheduler answers at tls://127.0.0.1:9: ."),
    ):
        opened.result()


class KillOneWorker:
    """Progress that kills a worker process the first time that something, but not everything, is done."""

    def __init__(self):
        self.killed = None

    def __call__(self, done, total):
        if self.killed is None and 0 < done < total:
            from distributed import LocalCluster

            [here] = LocalCluster._instances
            self.killed = next(iter(here.workers.values())).pid
            os.kill(self.killed, signal.SIGKILL)


class InterruptOnce:
    """Progress that raises SIGINT the first time that something, but not everything, is done."""

    def __init__(self):
        self.due = True

    def __call__(self, done, total):
        if self.due and 0 < done < total:
            self.due = False
            signal.raise_signal(signal.SIGINT)


@pytest.mark.long
def test_two_workers_one_killed_give_the_bytes_of_one_machine(tmp_path):
    pytest.importorskip("distributed")
    one = table_bytes(nb.run(small(), tmp_path / "one").path)
    killer = KillOneWorker()
    killed = nb.run(small(), tmp_path / "killed", progress=killer, dask="local:2")
    assert killer.killed is not None
    assert table_bytes(killed.path) == one


@pytest.mark.long
def test_ctrl_c_saves_what_workers_gave_and_the_same_command_goes_on(tmp_path):
    pytest.importorskip("distributed")
    one = table_bytes(nb.run(small(), tmp_path / "one").path)
    with pytest.raises(Interrupted, match="the same command goes on"):
        nb.run(small(), tmp_path / "stopped", progress=InterruptOnce(), dask="local:2")
    seen = []
    resumed = nb.run(small(), tmp_path / "stopped", lambda done, total: seen.append(done), dask="local:2")
    assert seen[0] > 0
    assert table_bytes(resumed.path) == one


@pytest.mark.long
def test_a_scheduler_that_does_not_answer_is_said(tmp_path, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "SECONDS_TO_CONNECT", 1.0)
    begun = time.monotonic()
    with pytest.raises(EnvironmentFault, match="no dask scheduler answers"):
        nb.run(small(), tmp_path, dask="tcp://127.0.0.1:9")
    assert time.monotonic() - begun < 120


@pytest.mark.long
def test_a_second_cluster_starts_without_a_warning():
    pytest.importorskip("distributed")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with cluster.opening("local:1") as one, cluster.opening("local:1") as other:
            assert [sum(each.result().client.nthreads().values()) for each in (one, other)] == [1, 1]
    assert not [each for each in said if "Port" in str(each.message)]
