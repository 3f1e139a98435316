"""What an earlier run left in its folder: finished results, or a checkpoint to go on from."""

from __future__ import annotations

import logging

import jax

from nlbench.engine.compiled import Compiled
from nlbench.errors import DamagedResults, EnvironmentFault
from nlbench.results.fingerprint import differences, fingerprint
from nlbench.results.folder import RunFolder
from nlbench.results.results import Results
from nlbench.statistics.totals import Totals

log = logging.getLogger("nlbench")


def finished_runs(folder: RunFolder) -> int | None:
    """How many runs are done; None if none are, or if that cannot be told."""
    try:
        return folder.done_runs()
    except DamagedResults as fault:
        log.warning("%s; it is written anew", fault)
        return None


def sound(folder: RunFolder) -> bool:
    """Whether a finished run still is what it wrote."""
    try:
        faults = Results(folder.path).damaged()
    except DamagedResults as unreadable:
        faults = [str(unreadable)]
    for fault in faults:
        log.warning("%s; it is computed anew", fault)
    return not faults


def resumed(folder: RunFolder, compiled: Compiled) -> Totals:
    """Totals of the checkpoint, or fresh ones. Raises `EnvironmentFault` if other software made the checkpoint."""
    try:
        saved = folder.load_checkpoint()
    except DamagedResults as fault:
        log.warning("%s; the run starts again", fault)
        saved = None
    if saved is None:
        return Totals(compiled.problem.layout)
    arrays, facts = saved
    changed = differences(numerics(compiled), facts["fingerprint"])
    if changed:
        raise EnvironmentFault(
            f"{folder.path} was computed with other software or hardware ({'; '.join(changed)}), and mixing them "
            "would change digits: choose another folder with --out, or delete that one"
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


def checkpoint(folder: RunFolder, compiled: Compiled, totals: Totals) -> None:
    """Save the totals of the blocks so far."""
    folder.save_checkpoint(totals.state(), fingerprint=numerics(compiled))


def numerics(compiled: Compiled) -> dict[str, str]:
    """Everything that decides the last bits: software, hardware, settings, and the program itself."""
    return {**fingerprint(device()), "program": compiled.program}


def device() -> str:
    """The kind of device that computes."""
    return jax.devices()[0].device_kind
