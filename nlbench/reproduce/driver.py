"""Runs experiments side by side, each as a process of its own with one thread: most of a short run is compiling."""

from __future__ import annotations

import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

from nlbench.errors import DamagedResults, Interrupted
from nlbench.reproduce.jobs import Job
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results

SECONDS_BETWEEN_LOOKS = 0.1
LONGEST_FAULT = 300


class Outcome(NamedTuple):
    """How a job ended: the exit code of its process, what it complained of, how long this call spent on it.

    A process that a signal killed when its results were complete has code 0, and the signal stands in `fault`.
    `seconds` is None where its results were there before.
    """

    job: Job
    code: int
    fault: str
    seconds: float | None


class _Running(NamedTuple):
    job: Job
    process: subprocess.Popen
    complaints: IO[bytes]
    begun: float


def run(
    jobs: Iterable[Job], out: Path, workers: int, report: Callable[[Outcome], None]
) -> dict[str, Outcome]:
    """Run what is not done yet, the longest first. `report` is called with each outcome as it comes.

    A failing job does not stop the others. Asked to stop (SIGINT or SIGTERM), all processes are asked to; they save
    what they have, and `Interrupted` is raised.
    """
    outcomes: dict[str, Outcome] = {}

    def ended(outcome: Outcome) -> None:
        outcomes[outcome.job.name] = outcome
        report(outcome)

    waiting: deque[Job] = deque()
    for job in sorted(jobs, key=lambda job: -job.work):
        if done(job):
            ended(Outcome(job, 0, "", None))
        else:
            waiting.append(job)
    running: list[_Running] = []
    passed_on = 0
    with _stop_requests() as stopped:
        while running or (waiting and not stopped()):
            while waiting and len(running) < workers and not stopped():
                running.append(_start(waiting.popleft(), out))
            time.sleep(SECONDS_BETWEEN_LOOKS)
            while passed_on < stopped():
                passed_on += 1
                for each in running:
                    each.process.send_signal(signal.SIGTERM)
            for each in [each for each in running if each.process.poll() is not None]:
                running.remove(each)
                ended(_outcome(each))
        if stopped():
            raise Interrupted(
                f"stopped with {len(outcomes)} experiments done; the same command goes on from what was saved"
            )
    return outcomes


def done(job: Job) -> bool:
    """Whether the results are there, undamaged, of as many runs, and read by the same claims."""
    folder, results = RunFolder(job.folder), Results(job.folder)
    try:
        runs = folder.done_runs()
        if runs is None or runs < job.runs or not (job.folder / "report.html").exists():
            return False
        saved = results.experiment
        same = {"monte_carlo": saved.monte_carlo, "engine": saved.engine}
        costed = "cost" in results.tables or not job.experiment.engine.cost
        return costed and saved == job.experiment.model_copy(update=same) and not results.damaged()
    except DamagedResults:
        return False


def _start(job: Job, out: Path) -> _Running:
    # A process group of its own: Ctrl-C reaches it through us, once, and not from the terminal as well.
    options = ["--runs", str(job.runs), "--out", str(out), "--json"]
    options += [part for each in ("engine.threads=1", *job.settings) for part in ("--set", each)]
    complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed when the process has ended
    process = subprocess.Popen(
        [sys.executable, "-m", "nlbench", "run", str(job.file), *options],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=complaints,
        process_group=0,
    )
    return _Running(job, process, complaints, time.monotonic())


def _outcome(ended: _Running) -> Outcome:
    ended.complaints.seek(0)
    said = ended.complaints.read().decode(errors="replace")
    ended.complaints.close()
    code = ended.process.returncode
    fault = " ".join(said.split())[-LONGEST_FAULT:] if code else ""
    if code < 0:
        signalled = f"killed by signal {-code} ({signal.Signals(-code).name})"
        if done(ended.job):  # libraries have aborted on their way out; results count, not the process
            code, fault = 0, f"{signalled} after its results were written"
        else:
            fault = f"{signalled} {fault}".strip()
    return Outcome(ended.job, code, fault, time.monotonic() - ended.begun)


@contextmanager
def _stop_requests() -> Iterator[Callable[[], int]]:
    """A function that says how often SIGINT or SIGTERM has come."""
    asked: list[int] = []

    def note(number: int, frame: Any) -> None:
        asked.append(number)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: len(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
