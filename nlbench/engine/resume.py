"""What a run leaves in its folder for a later one: finished results, or a checkpoint to go on from."""

from __future__ import annotations

import logging
import time

import jax

from nlbench.engine.compiled import Compiled
from nlbench.errors import DamagedResults, EnvironmentFault
from nlbench.results.fingerprint import differences, fingerprint
from nlbench.results.folder import CHECKPOINT, RunFolder
from nlbench.results.manifest import SCHEMA
from nlbench.results.results import Results
from nlbench.statistics.totals import Totals

SECONDS_BETWEEN_CHECKPOINTS = 5.0
UNSAID = 2  # schema of checkpoints that do not say theirs
CHECKPOINT_SHARE = 30  # ... or more, so that writing large ones takes a thirtieth of the time
log = logging.getLogger("nlbench")


def finished_runs(folder: RunFolder) -> int | None:
    """How many runs are done; None if none are, or if that cannot be told."""
    try:
        done = folder.done_runs()
        if done is not None:
            results = Results(folder.path)
            results.check_done()
            _ = results.manifest[
                "runs"
            ]  # without a sound manifest the mark is not believed: it may be edited, too
    except DamagedResults as fault:
        log.warning("%s; it is written anew", fault)
        return None
    return done


def sound(folder: RunFolder) -> bool:
    """Whether a finished run still is what it wrote."""
    faults = Results(folder.path).damaged()
    for fault in faults:
        log.warning("%s; it is computed anew", fault)
    return not faults


def resumed(folder: RunFolder, compiled: Compiled) -> Totals:
    """Totals of the checkpoint, or fresh ones. Raises `EnvironmentFault` if other software made the checkpoint."""
    try:
        saved = loaded(folder, compiled, "choose another folder with --out, or delete that one")
    except DamagedResults as fault:
        log.warning("%s; the run starts again", fault)
        saved = None
    return Totals(compiled.problem.layout) if saved is None else saved


def loaded(folder: RunFolder, compiled: Compiled, advice: str) -> Totals | None:
    """Totals of the checkpoint, None where there is none.

    Raises `DamagedResults`, and `EnvironmentFault`, with the advice, if other software made it.
    """
    saved = folder.load_checkpoint()
    if saved is None:
        return None
    arrays, facts = saved
    schema = facts.get("schema", UNSAID)
    if schema != SCHEMA:
        raise EnvironmentFault(
            f"{folder.path / CHECKPOINT}: schema {schema}, this version of nlbench writes schema {SCHEMA}: {advice}"
        )
    changed = differences(numerics(compiled), facts["fingerprint"])
    if changed:
        raise EnvironmentFault(
            f"{folder.path} was computed with other software or hardware ({'; '.join(changed)}), and mixing them "
            f"would change digits: {advice}"
        )
    return Totals.from_state(compiled.problem.layout, arrays)


def same_program(folder: RunFolder, compiled: Compiled) -> None:
    """Raises `EnvironmentFault` if a finished run was computed by another program.

    The source of a plug-in, which is part of the run's name, does not hold what it imports or reads.
    """
    then, now = Results(folder.path).manifest["fingerprint"], numerics(compiled)
    # Other software may make another program of the same plug-in, and the results are as good as ever.
    if then != now and then == {**now, "program": then.get("program")}:
        raise EnvironmentFault(
            f"{folder.path} was computed by another program, though the plug-in is the same: something that it imports "
            "or reads has changed; choose another folder with --out, or delete that one"
        )


class Saver:
    """Saves totals now and then, and knows which are saved."""

    def __init__(self, folder: RunFolder, compiled: Compiled, totals: Totals):
        """totals: those of the checkpoint, or fresh ones."""
        self._folder, self._compiled = folder, compiled
        self._blocks, self._at, self._pause = totals.blocks, time.monotonic(), SECONDS_BETWEEN_CHECKPOINTS

    def now_and_then(self, totals: Totals) -> None:
        """Save the totals if the last time is long enough ago."""
        begun = time.monotonic()
        if begun - self._at > self._pause:
            self.save(totals)
            self._at = time.monotonic()
            self._pause = max(self._pause, CHECKPOINT_SHARE * (self._at - begun))

    def save(self, totals: Totals) -> None:
        """Save the totals unless they are saved."""
        if totals.blocks != self._blocks:
            save(self._folder, self._compiled, totals)
            self._blocks = totals.blocks


def save(folder: RunFolder, compiled: Compiled, totals: Totals) -> None:
    """Make these totals the checkpoint."""
    folder.save_checkpoint(totals.state(), schema=SCHEMA, fingerprint=numerics(compiled))


def numerics(compiled: Compiled) -> dict[str, str]:
    """Everything that decides the last bits: software, hardware, settings, and the program itself."""
    return {**fingerprint(device()), "program": compiled.program}


def device() -> str:
    """The kind of device that computes."""
    return jax.devices()[0].device_kind
