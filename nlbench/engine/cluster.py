"""Workers on other machines, or in other processes, by dask.distributed; loaded only where that is asked for.

The run stays with the client: it alone merges, in block order, and writes. A task is a range of blocks, computed anew
elsewhere when its worker is lost. Numbers of blocks go out and sums come back, so there is nothing else to lose.
"""

from __future__ import annotations

import importlib.util
import logging
import re
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from nlbench.engine import remote
from nlbench.engine.memory import ran_out
from nlbench.errors import ConfigError, EnvironmentFault

if TYPE_CHECKING:
    from nlbench.engine.workers import Part

INSTALL = "--dask needs dask.distributed, which is not installed: pip install 'nlbench[cluster]'"
SECONDS_TO_CONNECT = 20.0
SECONDS_WITHOUT_WORKERS = 120.0
SECONDS_BETWEEN_LOOKS = 1.0
MOST_DEATHS = 3  # how often dask may give up a task, each time after it killed several workers
# For processes started here: what dask does by itself, for displays that nobody looks at, took 5 % of two cores.
QUIET = {
    "distributed.admin.tick.interval": "2s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.profile.enabled": False,
}
SAVED = "what was merged is saved, and the same command goes on from there"
log = logging.getLogger("nlbench")


def checked(address: str) -> int:
    """How many local processes `address` asks for, 0 for a scheduler. Raises `ConfigError` where that cannot be."""
    local = re.fullmatch(r"local:([1-9][0-9]{0,2})", address)
    if not local and not re.fullmatch(r"(tcp|tls|ucx|wss?)://\S+:[0-9]+", address):
        raise ConfigError(
            f"--dask: got '{address}'; expected the address of a scheduler, tcp://HOST:PORT, or local:N for N processes"
        )
    if importlib.util.find_spec("distributed") is None:
        raise ConfigError(INSTALL)
    return int(local[1]) if local else 0


class Opened(NamedTuple):
    """A client, and the cluster of processes that was started for it, if one was."""

    client: Any
    cluster: Any


@contextmanager
def opening(address: str) -> Iterator[Future[Opened]]:
    """The workers at `address`, which are connected to, or started, while the caller does something else; closed at the
    end if they were started here.

    The future raises `EnvironmentFault` where no scheduler answers. Raises `ConfigError` for an address that is none.
    """
    processes = checked(address)
    with ThreadPoolExecutor(1, "nlbench-opening") as pool:
        opened = pool.submit(_open, address, processes)
        try:
            yield opened
        finally:
            with suppress(Exception):  # where it failed there is nothing to close
                for each in filter(None, opened.result()):
                    with suppress(Exception):  # what is gone cannot be closed
                        each.close()


def _open(address: str, processes: int) -> Opened:
    import dask
    from distributed import Client, LocalCluster

    cluster: Any = None
    try:
        if processes:
            with dask.config.set(QUIET):
                cluster = LocalCluster(
                    n_workers=processes,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # any port, so that a second cluster finds one without a warning
                    scheduler_kwargs={"dashboard": False},
                    worker_dashboard_address=None,
                    preload=[remote.__name__],
                    silence_logs=logging.CRITICAL,
                )
        return Opened(Client(cluster or address, timeout=SECONDS_TO_CONNECT, set_as_default=False), cluster)
    except Exception as error:  # no answer, other versions, no certificates: each has an error of its own
        if cluster is not None:
            cluster.close()
        raise EnvironmentFault(f"no dask scheduler answers at {address}: {_said(error)}") from error


def _said(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


def _told(error: Exception) -> Exception:
    """An error of a worker as the user has to know it: where nlbench is missing or another version there, say, its
    words are about a module or a file that the user never wrote."""
    if ran_out(error) or isinstance(error, EnvironmentFault):
        return error
    name = type(error).__name__
    return EnvironmentFault(
        f"a worker failed: {name}: {_said(error)}; workers need the environment of this machine; {SAVED}"
    )


class Dask:
    """Threads of all workers of a scheduler, those that come later included; calls of lost ones are made again."""

    def __init__(self, client: Any, task: remote.Task):
        self.at_once = 1
        self._client, self._task = client, task
        self._lock = threading.Lock()
        self._pending: dict[Future[Part], Any] = {}
        self._closed = threading.Event()
        self._look()
        threading.Thread(target=self._watch, name="nlbench-dask", daemon=True).start()

    def submit(self, first: int, count: int) -> Future[Part]:
        """Begin to compute blocks first ... first + count - 1."""
        promised: Future[Part] = Future()
        promised.set_running_or_notify_cancel()
        self._send(promised, first, count, 0)
        return promised

    def __enter__(self) -> Dask:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Want nothing any more."""
        self._closed.set()
        with self._lock:
            pending, self._pending = dict(self._pending), {}
        with suppress(Exception):
            self._client.cancel(list(pending.values()), force=True)

    def _send(self, promised: Future[Part], first: int, count: int, deaths: int) -> None:
        # Not pure: the same call made twice in one cluster would otherwise be one, and its result could be lost twice.
        task = self._client.submit(remote.compute, self._task, first, count, pure=False)
        with self._lock:
            self._pending[promised] = task
        task.add_done_callback(partial(self._ended, promised, first, count, deaths))

    def _ended(self, promised: Future[Part], first: int, count: int, deaths: int, task: Any) -> None:
        from concurrent.futures import CancelledError

        from distributed.scheduler import KilledWorker

        if self._closed.is_set() or promised.done():
            return
        try:
            part = task.result()
        except KilledWorker as killed:
            if deaths < MOST_DEATHS:
                log.warning("workers were lost with blocks %d to %d; sent again", first, first + count - 1)
                self._send(promised, first, count, deaths + 1)
            else:
                self._fail(
                    promised,
                    EnvironmentFault(f"blocks kill each worker that computes them: {killed}; {SAVED}"),
                )
        except CancelledError:
            self._fail(promised, EnvironmentFault(f"the dask scheduler is gone; {SAVED}"))
        except Exception as error:
            self._fail(promised, _told(error))
        else:
            with self._lock:
                self._pending.pop(promised, None)
            with suppress(Exception):  # given up meanwhile
                promised.set_result(part)

    def _fail(self, promised: Future[Part], error: Exception) -> None:
        with self._lock:
            self._pending.pop(promised, None)
        with suppress(Exception):  # given up meanwhile
            promised.set_exception(error)

    def _look(self) -> int:
        """Count the threads of all workers."""
        threads = sum(self._client.nthreads().values())
        self.at_once = max(1, threads)
        return threads

    def _watch(self) -> None:
        """Wait some time for workers where there are none, then give up."""
        seen = time.monotonic()
        said = False
        while not self._closed.wait(SECONDS_BETWEEN_LOOKS):
            try:
                alive = self._look() > 0
            except Exception:  # whatever dask raises when its scheduler does not answer
                alive = False
            if alive:
                seen, said = time.monotonic(), False
            elif not said:
                log.warning("no dask worker; waiting up to %.0f s for one", SECONDS_WITHOUT_WORKERS)
                said = True
            elif time.monotonic() - seen > SECONDS_WITHOUT_WORKERS:
                with self._lock:
                    pending = list(self._pending)
                for promised in pending:
                    self._fail(
                        promised,
                        EnvironmentFault(f"no dask worker for {SECONDS_WITHOUT_WORKERS:.0f} s; {SAVED}"),
                    )
